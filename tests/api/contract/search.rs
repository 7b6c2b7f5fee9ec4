//! The list of scans, searched, filtered and ordered, beside what a look at every scan gives.

use super::*;
use ventriform_service::base::records::{
    JobOnScan, MadeOfScan, ScanLists, ScanOrder, ScanSearch, SearchedWords, WhichScan,
};

/// A scan that is searched, as a test knows it.
struct Searched {
    sequence: i64,
    id: String,
    bytes: u64,
    tags: Tags,
    fields: Map<String, Value>,
    made: BTreeSet<&'static str>,
    failed: bool,
}

impl Searched {
    fn field(&self, name: &str) -> &str {
        self.fields.get(name).and_then(Value::as_str).unwrap_or("")
    }

    /// Everything that is searched, in small letters.
    fn texts(&self, personal: bool) -> Vec<String> {
        let open = [
            "modality",
            "radiopharmaceutical",
            "radionuclide",
            "rest_or_stress",
        ];
        let named = [
            "patient_name",
            "patient_id",
            "study_date",
            "accession_number",
            "study_description",
            "series_description",
        ];
        let mut texts: Vec<String> = open.iter().map(|name| self.field(name).into()).collect();
        if personal {
            texts.extend(named.iter().map(|name| self.field(name).to_owned()));
            texts.extend(self.tags.external_id.clone());
            let labels = self.tags.labels.iter();
            texts.extend(labels.map(|(name, value)| format!("{name}:{value}")));
            if let [a, b, c, d, m, n, e, f] = self.field("study_date").as_bytes() {
                let day = [a, b, c, d, &b'-', m, n, &b'-', e, f].map(|byte| *byte);
                texts.push(String::from_utf8(day.into()).unwrap());
            }
        }
        texts.iter().map(|text| text.to_lowercase()).collect()
    }

    fn matches(&self, search: &ScanSearch) -> bool {
        let has = |word: &String, personal| {
            let word = word.to_lowercase();
            let is_of_id = word.len() >= 4 && self.id["vol_".len()..].starts_with(&word);
            is_of_id || self.texts(personal).iter().any(|text| text.contains(&word))
        };
        let studied = self.field("study_date");
        let words = search.words.as_ref();
        words.is_none_or(|words| words.words.iter().all(|word| has(word, words.personal)))
            && search.made.is_none_or(|made| match made {
                MadeOfScan::Nothing => self.made.is_empty(),
                made => self.made.contains(made.as_str()),
            })
            && (search.job != Some(JobOnScan::Failed) || self.failed)
            && (search.modality.as_ref()).is_none_or(|one| self.field("modality") == one)
            && (search.rest_or_stress)
                .is_none_or(|role| self.field("rest_or_stress") == role.as_str())
            && (search.patient.as_ref()).is_none_or(|one| self.field("patient_id") == one)
            && (search.study_date_from.as_ref()).is_none_or(|day| studied >= day.as_str())
            && (search.study_date_to.as_ref())
                .is_none_or(|day| !studied.is_empty() && studied <= day.as_str())
    }

    /// What it is ordered by; numbers by their values.
    fn key(&self, order: ScanOrder) -> (String, u64) {
        let padded = |text: &str| {
            let mut done = String::new();
            let mut digits = String::new();
            for letter in text.to_ascii_lowercase().chars().chain(['\n']) {
                if letter.is_ascii_digit() {
                    digits.push(letter);
                    continue;
                }
                if !digits.is_empty() {
                    done += &format!("{digits:0>12}");
                    digits.clear();
                }
                done.push(letter);
            }
            done.trim_end().to_owned()
        };
        let name = [self.field("patient_name"), self.field("patient_id")];
        let patient = name.into_iter().find(|text| !text.is_empty());
        let own = self.tags.external_id.as_ref();
        let own = own.or_else(|| self.tags.labels.get("name"));
        match order {
            ScanOrder::Newest => (String::new(), 0),
            ScanOrder::StudyDate => (self.field("study_date").to_owned(), 0),
            ScanOrder::Patient => (patient.map_or("\u{10ffff}".into(), padded), 0),
            ScanOrder::Name => match own {
                Some(own) => (padded(own), 0),
                None => (format!("scan {}", &self.id[4..12]), 0),
            },
            ScanOrder::Largest => (String::new(), self.bytes),
        }
    }
}

/// All that a search should find, in its order.
fn expected(scans: &[Searched], search: &ScanSearch) -> Vec<String> {
    let mut found: Vec<&Searched> = scans.iter().filter(|scan| scan.matches(search)).collect();
    let ascends = matches!(search.order, ScanOrder::Patient | ScanOrder::Name);
    found.sort_by_key(|scan| (scan.key(search.order), scan.sequence));
    if !ascends {
        found.reverse();
    }
    found.into_iter().map(|scan| scan.id.clone()).collect()
}

/// Numbers that look random and are the same in every run.
struct Dice(u64);

impl Dice {
    fn below(&mut self, count: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = self.0.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % count
    }

    fn one_of<'a>(&mut self, texts: &[&'a str]) -> &'a str {
        texts[self.below(texts.len())]
    }
}

/// Stores a scan with random fields, tags, results and jobs.
async fn scan_to_search(on: &Stores, dice: &mut Dice, number: usize) -> Searched {
    let id = random_id(Resource::Volume.prefix());
    let names = [
        "Smith^Anna",
        "SMITH^BOB",
        "Müller^Jörg",
        "MÜLLER^INA",
        "O_Neil^50%",
        "",
    ];
    let mut fields = Map::new();
    let mut set = |name: &str, value: String| {
        if !value.is_empty() {
            fields.insert(name.into(), value.into());
        }
    };
    set("patient_name", dice.one_of(&names).to_owned());
    set(
        "patient_id",
        dice.one_of(&["", "P-2", "P-10", "77"]).to_owned(),
    );
    let day = format!("2026{:02}{:02}", 1 + dice.below(12), 1 + dice.below(28));
    set(
        "study_date",
        if dice.below(4) == 0 {
            String::new()
        } else {
            day
        },
    );
    set("modality", dice.one_of(&["NM", "PT", ""]).to_owned());
    set(
        "rest_or_stress",
        dice.one_of(&["rest", "stress", ""]).to_owned(),
    );
    set(
        "series_description",
        dice.one_of(&["Gated\u{0}SPECT", "rest", ""]).to_owned(),
    );
    set(
        "radiopharmaceutical",
        dice.one_of(&["Sestamibi", ""]).to_owned(),
    );
    let mut tags = Tags::default();
    match dice.below(3) {
        0 => tags.external_id = Some(format!("scan {number}")),
        1 => _ = tags.labels.insert("name".into(), format!("Ward\\{number}")),
        _ => {}
    }
    let bytes = 1 + dice.below(5) as u64;
    let volume = stored_volume(&id, bytes);
    let scan = ScanFields(fields.clone());
    let scan = (dice.below(6) > 0).then_some(&scan);
    on.a.add_volume(&volume, &tenant(), &tags, scan)
        .await
        .unwrap();
    if scan.is_none() {
        fields.clear();
    }
    let mut made = BTreeSet::new();
    for kind in [
        Resource::Model,
        Resource::Segmentation,
        Resource::Comparison,
    ] {
        if dice.below(4) == 0 {
            let product = product(random_id(kind.prefix()), Some(&id));
            on.a.add_product(&product, &tenant(), Some(&id), AMPLE_ROOM)
                .await
                .unwrap();
            made.insert(kind.noun());
        }
    }
    let failed = dice.below(8) == 0;
    if failed {
        on.file(&new_job(&id)).await;
        let (_, lease) = on.claim().await.unwrap();
        let outcome = JobOutcome::Failed(failure("test"));
        on.b.finish(&lease, &outcome, now()).await.unwrap().unwrap();
    }
    let held = on.b.volume(&tenant(), &id).await.unwrap().unwrap();
    Searched {
        sequence: held.sequence,
        id,
        bytes,
        tags,
        fields,
        made,
        failed,
    }
}

/// Every order by every filter alone and with words.
fn scan_searches() -> Vec<ScanSearch> {
    let words = |text: &str, personal| {
        Some(SearchedWords {
            words: text.split(' ').map(str::to_owned).collect(),
            personal,
        })
    };
    let mut searches = Vec::new();
    for order in ScanOrder::ALL {
        let base = || ScanSearch {
            order,
            ..ScanSearch::default()
        };
        let mut add = |change: &dyn Fn(&mut ScanSearch)| {
            let mut search = base();
            change(&mut search);
            searches.push(search);
        };
        add(&|_| ());
        for text in [
            "smith",
            "SMITH anna",
            "müller",
            "MÜLLER",
            "o_neil",
            "50%",
            "%",
            "name:ward\\",
            "scan 1",
            "2026-0",
            "p-10 smith",
            "nobody",
            "gated",
        ] {
            add(&|search| search.words = words(text, true));
        }
        for text in ["smith", "sestamibi", "rest nm", "p-10"] {
            add(&|search| search.words = words(text, false));
        }
        for made in MadeOfScan::ALL {
            add(&|search| search.made = Some(made));
        }
        add(&|search| search.job = Some(JobOnScan::Failed));
        add(&|search| search.modality = Some("PT".into()));
        add(&|search| search.rest_or_stress = Some(WhichScan::Stress));
        add(&|search| search.patient = Some("77".into()));
        add(&|search| search.study_date_from = Some("20260601".into()));
        add(&|search| search.study_date_to = Some("20260601".into()));
        add(&|search| {
            search.words = words("smith", true);
            search.made = Some(MadeOfScan::Nothing);
            search.rest_or_stress = Some(WhichScan::Rest);
        });
    }
    searches
}

/// The ids of every page of a search; `between` runs after each page.
async fn paged(
    on: &Stores,
    filter: &ItemFilter,
    limit: u32,
    mut between: impl AsyncFnMut(),
) -> Vec<String> {
    let (mut ids, mut before) = (Vec::new(), None);
    loop {
        let page = ListRequest { before, limit };
        let found = on.b.find_scans(&tenant(), filter, page).await.unwrap();
        let found = found.expect("the row at which the page before ended");
        assert!(found.sequences.len() <= limit as usize);
        let volumes = on.b.volumes_at(&tenant(), &found.sequences).await.unwrap();
        let sequences: Vec<i64> = volumes.iter().map(|volume| volume.sequence).collect();
        assert_eq!(sequences, found.sequences);
        ids.extend(volumes.into_iter().map(|volume| volume.item.id));
        let Some(next) = found.next else { return ids };
        before = Some(next);
        between().await;
    }
}

pub(super) async fn scans_are_searched_as_a_whole(on: &Stores) {
    let mut dice = Dice(7);
    let mut scans = Vec::new();
    for number in 0..60 {
        scans.push(scan_to_search(on, &mut dice, number).await);
    }
    // Another tenant's scans are never found.
    let id = random_id(Resource::Volume.prefix());
    let named = ScanFields(object(json!({"patient_name": "Smith^Other"})));
    on.a.add_volume(
        &stored_volume(&id, 1),
        &other(),
        &Tags::default(),
        Some(&named),
    )
    .await
    .unwrap();
    let searches = scan_searches();
    for search in &searches {
        let filter = ItemFilter {
            search: search.clone(),
            ..ItemFilter::default()
        };
        for limit in [7, 100] {
            let found = paged(on, &filter, limit, async || ()).await;
            assert_eq!(found, expected(&scans, search), "{search:?} by {limit}");
        }
    }
    let finds = |search: &&ScanSearch| !expected(&scans, search).is_empty();
    assert!(searches.iter().filter(finds).count() > searches.len() / 2);
    // Ids are found by their beginnings, and scans by the ids of what was made of them.
    let model = model(&scans[3].id);
    on.a.add_product(&model, &tenant(), Some(&scans[3].id), AMPLE_ROOM)
        .await
        .unwrap();
    // The first eight figures of an id are the minute in which it was made.
    let (whole, part) = (&scans[3].id, &scans[3].id[4..24]);
    for word in [
        whole.as_str(),
        &whole[..30],
        part,
        &part.to_uppercase(),
        &model.id,
    ] {
        let mut filter = ItemFilter::default();
        filter.search.words = Some(SearchedWords {
            words: vec![word.to_owned()],
            personal: false,
        });
        assert_eq!(
            paged(on, &filter, 9, async || ()).await,
            std::slice::from_ref(whole),
            "{word}"
        );
    }
    // The other filters of lists.
    let mut filter = ItemFilter::default();
    filter.search.order = ScanOrder::Name;
    filter.tags.external_id = Some("scan 0".into());
    let with = |scan: &Searched| scan.tags.external_id == filter.tags.external_id;
    let own: Vec<_> = scans
        .iter()
        .filter(|scan| with(scan))
        .map(|scan| scan.id.clone())
        .collect();
    assert_eq!(paged(on, &filter, 9, async || ()).await, own);
}

pub(super) async fn pages_of_a_search_have_no_gaps_while_scans_come_and_go(on: &Stores) {
    let mut dice = Dice(3);
    let mut scans = Vec::new();
    for number in 0..30 {
        scans.push(scan_to_search(on, &mut dice, number).await);
    }
    for order in ScanOrder::ALL {
        let mut filter = ItemFilter::default();
        filter.search.order = order;
        let before = expected(&scans, &filter.search);
        let mut added = Vec::new();
        let found = paged(on, &filter, 4, async || {
            added.push(scan_to_search(on, &mut dice, 100).await);
        })
        .await;
        let old: Vec<_> = found
            .iter()
            .filter(|id| before.contains(id))
            .cloned()
            .collect();
        assert_eq!(old, before, "{order:?}");
        let once: BTreeSet<_> = found.iter().collect();
        assert_eq!(once.len(), found.len(), "{order:?}");
        scans.extend(added);
        assert_eq!(
            paged(on, &filter, 100, async || ()).await,
            expected(&scans, &filter.search)
        );
    }
    // A page begins after a row that is there to tell; in the order of arrival, the number alone tells.
    let mut filter = ItemFilter::default();
    filter.search.order = ScanOrder::Name;
    let first = ListRequest {
        before: None,
        limit: 5,
    };
    let found = on.b.find_scans(&tenant(), &filter, first).await.unwrap();
    let (found, gone) = found
        .map(|found| (found.sequences.clone(), found.next))
        .unwrap();
    let id = scans
        .iter()
        .find(|scan| Some(scan.sequence) == gone)
        .unwrap();
    let id = id.id.clone();
    let expected_ids = [id.clone()].into_iter();
    let all: Vec<String> = on.a.made_of(&tenant(), &id).await.unwrap();
    let all: Vec<String> = expected_ids.chain(all).collect();
    let erased = on.a.erase(&erasure(&id, true), &all, now()).await.unwrap();
    assert!(matches!(erased, Erased::Done(_)), "{erased:?}");
    let second = ListRequest {
        before: gone,
        limit: 5,
    };
    assert_eq!(
        on.b.find_scans(&tenant(), &filter, second).await.unwrap(),
        None
    );
    filter.search.order = ScanOrder::Newest;
    assert!(
        on.b.find_scans(&tenant(), &filter, second)
            .await
            .unwrap()
            .is_some()
    );
    let left = on.b.volumes_at(&tenant(), &found).await.unwrap();
    assert_eq!(left.len(), found.len() - 1);
}

pub(super) async fn a_search_knows_what_has_changed(on: &Stores) {
    let scan = |name: &str| ScanFields(object(json!({"patient_name": name})));
    let id = random_id(Resource::Volume.prefix());
    let tags = Tags {
        external_id: Some("first".into()),
        ..Tags::default()
    };
    on.a.add_volume(
        &stored_volume(&id, 1),
        &tenant(),
        &tags,
        Some(&scan("Doe^Jane")),
    )
    .await
    .unwrap();
    let finds = async |change: &dyn Fn(&mut ScanSearch)| {
        let mut filter = ItemFilter::default();
        change(&mut filter.search);
        !paged(on, &filter, 9, async || ()).await.is_empty()
    };
    let by = |word: &str| {
        let word = word.to_owned();
        move |search: &mut ScanSearch| {
            search.words = Some(SearchedWords {
                words: vec![word.clone()],
                personal: true,
            });
        }
    };
    assert!(finds(&by("doe^jane")).await && finds(&by("first")).await);
    let named = Tags {
        external_id: None,
        labels: [("name".to_owned(), "second".to_owned())].into(),
    };
    assert!(
        on.a.change_tags(&tenant(), &id, &tags, &named)
            .await
            .unwrap()
    );
    assert!(finds(&by("name:second")).await && !finds(&by("first")).await);
    let stated = ScanFields(object(json!({"patient_id": "4711"})));
    assert!(on.a.state_scan(&tenant(), &id, &stated).await.unwrap());
    assert!(finds(&by("4711")).await && finds(&|s| s.patient = Some("4711".into())).await);
    assert!(on.a.erase_scan(&tenant(), &id, now()).await.unwrap());
    assert!(!finds(&by("doe")).await && !finds(&by("4711")).await && finds(&by("second")).await);
    let fit = product(random_id(Resource::Segmentation.prefix()), Some(&id));
    let fitted = |s: &mut ScanSearch| s.made = Some(MadeOfScan::Segmentation);
    assert!(!finds(&fitted).await);
    on.a.add_product(&fit, &tenant(), Some(&id), AMPLE_ROOM)
        .await
        .unwrap();
    assert!(finds(&fitted).await);
    let erase = async |id: &String| {
        let (order, alone) = (erasure(id, false), [id.clone()]);
        let erased = on.a.erase(&order, &alone, now()).await.unwrap();
        assert!(matches!(erased, Erased::Done(_)), "{erased:?}");
    };
    erase(&fit.id).await;
    assert!(!finds(&fitted).await);
    erase(&id).await;
    assert!(!finds(&|s| s.order = ScanOrder::Name).await);
}
