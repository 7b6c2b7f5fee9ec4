//! A self-contained HTML page, and the parts that pages have in common.
//!
//! Style, pictures and a small script are inside of the page; nothing is fetched, not even a font.
//! The page carries a Content-Security-Policy that allows just that style, that script and
//! embedded pictures. A page may embed data that the script draws in places that the page keeps for
//! it ([`place`]); without scripts these stay empty and unseen.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::table::{CellKind, Table};
use super::text::leaves;

const DOCUMENT_STYLE: &str = include_str!("document.css");
/// Built from `web/src/report.tsx`: draws the embedded data, to be touched.
const REPORT_SCRIPT: &str = include_str!("../../../assets/report.js");
/// The style of what it draws.
const REPORT_STYLE: &str = include_str!("../../../assets/report.css");

/// A page.
#[derive(Debug, Clone)]
pub struct HtmlDocument<'a> {
    /// Its title and first heading.
    pub title: &'a str,
    /// The line below.
    pub subtitle: &'a str,
    /// Its sections.
    pub body: Markup,
    /// Data for the script; without it the page has no script.
    pub data: Option<Value>,
    /// The last line.
    pub footer: &'a str,
}

impl HtmlDocument<'_> {
    /// The page as text.
    pub fn html(&self) -> String {
        html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta http-equiv="Content-Security-Policy"
                        content=(content_security_policy(self.data.is_some()));
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    title { (self.title) }
                    style { (PreEscaped(DOCUMENT_STYLE)) }
                    @if self.data.is_some() { style { (PreEscaped(REPORT_STYLE)) } }
                }
                body {
                    main {
                        header {
                            h1 { (self.title) }
                            p.soft { (self.subtitle) }
                        }
                        (self.body)
                        footer { (self.footer) }
                    }
                    @if let Some(data) = &self.data {
                        // Only inside of strings can JSON have this letter, which could end the element.
                        @let data = data.to_string().replace('<', "\\u003c");
                        script type="application/json" id="data" { (PreEscaped(data)) }
                        script { (PreEscaped(REPORT_SCRIPT)) }
                    }
                }
            }
        }
        .into_string()
    }
}

/// A place for what the script draws under that name.
pub fn place(name: &str) -> Markup {
    html! { div id=(name) hidden {} }
}

/// Permissions of a page, as the value of a `Content-Security-Policy` header: its style,
/// embedded pictures and, for a page with data, the script and the style of what that draws.
pub fn content_security_policy(scripted: bool) -> String {
    let hash = |text: &str| format!("'sha256-{}'", STANDARD.encode(Sha256::digest(text)));
    let (style, script) = if scripted {
        (
            format!("{} {}", hash(DOCUMENT_STYLE), hash(REPORT_STYLE)),
            format!(" script-src {};", hash(REPORT_SCRIPT)),
        )
    } else {
        (hash(DOCUMENT_STYLE), String::new())
    };
    format!(
        "default-src 'none'; img-src data:; style-src {style};{script} base-uri 'none'; form-action 'none'"
    )
}

/// An item of the first section of a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sign {
    /// All is well.
    Good,
    /// Somebody should look.
    Flag,
    /// Something is wrong.
    Bad,
}

/// The first section: a headline, and each check with whether it holds.
pub fn verdict(sign: Sign, headline: &str, checks: &[(bool, String)]) -> Markup {
    let mark = match sign {
        Sign::Good => "✓",
        Sign::Flag => "!",
        Sign::Bad => "✗",
    };
    html! {
        section.verdict.doubt[sign == Sign::Flag].bad[sign == Sign::Bad] {
            div.sign aria-hidden="true" { (mark) }
            div {
                h2 { (headline) }
                ul.checks {
                    @for (holds, text) in checks {
                        @let spoken = if *holds { "yes" } else { "no" };
                        li.no[!holds] aria-label=(format!("{spoken}: {text}")) { (text) }
                    }
                }
            }
        }
    }
}

/// A headline figure: the value large, its unit small beside it, a label below.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HeadlineFigure {
    /// The value as text.
    pub value: String,
    /// Its unit.
    pub unit: &'static str,
    /// Its label.
    pub label: String,
}

/// Headline figures side by side.
pub fn figures(figures: &[HeadlineFigure]) -> Markup {
    html! {
        div.figures {
            @for figure in figures {
                div.figure {
                    b { (figure.value) " " small { (figure.unit) } }
                    span { (figure.label) }
                }
            }
        }
    }
}

/// A table that is scrolled where there is no room for it; `name` says what it is.
pub fn table(table: &Table, name: &str) -> Markup {
    let number = |column: usize| table.columns[column].kind == CellKind::Number;
    let names_row = |column: usize| table.columns[column].kind == CellKind::Name;
    html! {
        div.scroll tabindex="0" role="group" aria-label=(format!("{name}, scrollable")) {
            table {
                thead {
                    tr {
                        @for (at, column) in table.columns.iter().enumerate() {
                            th.n[number(at)] scope="col" { (column.title) }
                        }
                    }
                }
                tbody {
                    @for row in &table.rows {
                        tr {
                            @for (at, cell) in row.iter().enumerate().take(table.columns.len()) {
                                @if names_row(at) {
                                    th scope="row" { (cell) }
                                } @else {
                                    td.n[number(at)] { (cell) }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// A section with a list of sentences; nothing where there is none.
pub fn notes<'a>(title: &str, notes: impl IntoIterator<Item = &'a str>) -> Markup {
    let mut notes = notes.into_iter().peekable();
    html! {
        @if notes.peek().is_some() {
            section {
                h2 { (title) }
                ul.warnings { @for note in notes { li { (note) } } }
            }
        }
    }
}

/// A section with a table for each JSON object that is not empty: its leaves by their dotted
/// paths, except for `warnings`, which [`notes`] shows.
pub fn particulars(tables: &[(&str, Value)]) -> Markup {
    let filled = tables
        .iter()
        .filter(|(_, value)| value.as_object().is_some_and(|map| !map.is_empty()));
    html! {
        section {
            details open {
                summary { "Particulars" }
                div.row {
                    @for (title, value) in filled {
                        div {
                            h3 { (title) }
                            table {
                                tbody {
                                    @for (path, text) in leaves(value) {
                                        @if path != "warnings" {
                                            tr { th scope="row" { (path) } td { (text) } }
                                        }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}
