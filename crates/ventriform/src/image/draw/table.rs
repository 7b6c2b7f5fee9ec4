//! A table, whatever it is shown in.

/// Rows of texts under titles.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// The columns.
    pub columns: Vec<TableColumn>,
    /// The rows: a text for each column.
    pub rows: Vec<Vec<String>>,
}

/// A column of a [`Table`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TableColumn {
    /// Its title.
    pub title: String,
    /// What its cells are.
    pub kind: CellKind,
}

/// What the cells of a column are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellKind {
    /// The name of the row.
    Name,
    /// Numbers, which end at the right.
    Number,
    /// Other texts.
    Text,
}

impl TableColumn {
    /// The names of the rows.
    pub fn name(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            kind: CellKind::Name,
        }
    }

    /// A column of numbers.
    pub fn number(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            kind: CellKind::Number,
        }
    }

    /// A column of other texts.
    pub fn text(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            kind: CellKind::Text,
        }
    }
}
