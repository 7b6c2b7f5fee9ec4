//! The polar map as JSON.

use serde_json::{Value, json};

use super::picture::rings;
use super::{COLUMNS, PolarMap, ROWS, territory};

/// Segments, extents, and the pixels in per cent of the reference (`null` where there is no
/// wall), and where the picture has them. Without orientation, no territories, and `null` for what depends on sides.
pub fn json(map: &PolarMap) -> Value {
    let round = |x: f64| (100.0 * x).round() / 100.0;
    let percent = |x: f64| {
        if map.reference > 0.0 {
            round(100.0 * x / map.reference)
        } else {
            0.0
        }
    };
    let segments: Vec<Value> = map
        .segments
        .iter()
        .map(|s| {
            json!({
                "number": s.number,
                "name": map.name_of(s.number),
                "territory": map.is_oriented().then(|| territory(s.number)),
                "mean_percent": s.mean_percent.map(round),
                "extent_percent": round(s.extent_percent),
                "area_mm2": round(s.area),
            })
        })
        .collect();
    let territories: Vec<Value> = map
        .territories
        .iter()
        .filter(|_| map.is_oriented())
        .map(|t| {
            json!({
                "name": t.name,
                "mean_percent": t.mean_percent.map(round),
                "extent_percent": round(t.extent_percent),
                "area_mm2": round(t.area),
            })
        })
        .collect();
    let rows_of_ends = |ends: &[f64; 4]| ends.map(|rows| (1e3 * rows).round() / 1e3);
    let ends: Vec<[f64; 4]> = map.levels.ends().iter().map(rows_of_ends).collect();
    let numbers: Vec<Vec<usize>> = (0..ROWS)
        .map(|row| {
            (0..COLUMNS)
                .map(|column| map.segment_of(row, column))
                .collect()
        })
        .collect();
    let rows: Vec<Value> = map
        .pixels
        .chunks(COLUMNS)
        .map(|row| row.iter().map(|p| p.map(|p| percent(p.max))).collect())
        .collect();
    json!({
        "reference": map.reference,
        "threshold_percent": 100.0 * map.threshold,
        "extent_percent": round(map.extent_percent),
        "note": "per cent of the hottest quarter of this scan's own wall; no normal database, not TPD",
        "segments": segments,
        "territories": territories,
        "rows": ROWS,
        "columns": COLUMNS,
        "orientation": map.orientation.as_str(),
        "first_column": map.is_oriented().then_some("lateral"),
        "direction": map.is_oriented().then_some("lateral, anterior, septal, inferior"),
        "values_percent": rows,
        "segment_of": numbers,
        "level_ends": ends,
        "rings": rings(map).map(|share| (1e4 * share).round() / 1e4),
    })
}
