//! Archives, folders and several files with more in them than a volume.

use super::objects::{archive, ct, files, read_files};
use super::*;
use crate::image::volume::nifti::{self, StoredType};
use crate::image::volume::{PhantomParameters, ReadLimits, phantom};
use flate2::write::GzEncoder;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use zip::CompressionMethod;

/// Files that lie beside scans on media and in folders.
fn company() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("LOCKFILE", Vec::new()),
        ("README.txt", b"Read me first.".to_vec()),
        ("__MACOSX/S/._scan.nii.gz", b"\0\x05\x16\x07".to_vec()),
        ("S/.DS_Store", vec![0, 0, 0, 1]),
        ("S/Thumbs.db", b"\xd0\xcf\x11\xe0".to_vec()),
        ("S/scan.json", b"{}".to_vec()),
        ("DICOMDIR", vec![0; 200]),
    ]
}

const ZIP_METHODS: [CompressionMethod; 2] =
    [CompressionMethod::Stored, CompressionMethod::Deflated];

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut packed = GzEncoder::new(Vec::new(), flate2::Compression::default());
    packed.write_all(bytes).unwrap();
    packed.finish().unwrap()
}

/// A small volume as a `.nii`, and its voxels.
fn nifti() -> (Vec<u8>, Vec<f32>) {
    let small = PhantomParameters {
        shape: [24, 20, 16],
        spacing_mm: [9.0; 3],
        ..PhantomParameters::default()
    };
    let made = phantom(&small, &Monitor::silent()).unwrap();
    let bytes = nifti::write(&made.volume, StoredType::Float32, false).unwrap();
    (bytes, made.volume.voxels)
}

/// `single` as a header and its voxels in two files.
fn pair(single: &[u8]) -> [Vec<u8>; 2] {
    let mut header = single[..348].to_vec();
    header[344..348].copy_from_slice(b"ni1\0");
    header[108..112].copy_from_slice(&0.0_f32.to_le_bytes());
    [header, single[352..].to_vec()]
}

/// Writes `content` into a folder, and returns its files.
fn folder(content: &[(&str, Vec<u8>)]) -> (tempfile::TempDir, Vec<VolumeFile>) {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in content {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    let files = VolumeFile::given(&[folder.path()], &ReadLimits::DEFAULT).unwrap();
    (folder, files)
}

#[test]
fn nifti_in_archives_and_folders_is_found_among_other_files() {
    let (single, voxels) = nifti();
    let [header, image] = pair(&single);
    let volumes: Vec<Vec<(&str, Vec<u8>)>> = vec![
        vec![("S/scan.nii", single.clone())],
        vec![("S/scan.nii.gz", gzip(&single))],
        vec![
            ("a/scan.hdr", header.clone()),
            ("a/scan.img", image.clone()),
        ],
        vec![("scan.img", image.clone()), ("scan.hdr", header.clone())],
        vec![("x.hdr.gz", gzip(&header)), ("x.img.gz", gzip(&image))],
        vec![
            ("a.hdr", header.clone()),
            ("a.img", image.clone()),
            // Voxels of something else.
            ("b.img", vec![7; 64]),
        ],
    ];
    for volume in volumes {
        let content: Vec<_> = company().into_iter().chain(volume.clone()).collect();
        for method in ZIP_METHODS {
            for content in [&volume, &content] {
                let reading = read_files(&[archive(content, method)]).unwrap();
                assert_eq!(reading.volume.voxels, voxels, "{method}");
            }
        }
        let (_kept, files) = folder(&content);
        let reading = read_files(&files).unwrap();
        assert_eq!(reading.volume.voxels, voxels);
        let noted: Vec<_> = reading.facts.warnings.iter().collect();
        assert!(noted.iter().any(|w| w.contains("LOCKFILE")), "{noted:?}");
        // Files that a person names one by one.
        let loose = content
            .iter()
            .filter(|(name, _)| !name.contains("__MACOSX"));
        let loose: Vec<_> = loose
            .map(|(name, bytes)| VolumeFile::in_memory(*name, bytes.clone()))
            .collect();
        let reading = read_files(&loose).unwrap();
        assert_eq!(reading.volume.voxels, voxels);
        let left = reading
            .facts
            .warnings
            .iter()
            .any(|w| w.contains("README.txt"));
        assert!(left, "{:?}", reading.facts.warnings);
    }
}

#[test]
fn two_volumes_and_headers_without_voxels_are_refused() {
    let (single, _) = nifti();
    let [header, image] = pair(&single);
    let refuse = |content: &[(&str, Vec<u8>)]| {
        let of_zip = read_files(&[archive(content, CompressionMethod::Deflated)]).unwrap_err();
        let (_kept, files) = folder(content);
        assert_eq!(
            std::mem::discriminant(&read_files(&files).unwrap_err()),
            std::mem::discriminant(&of_zip)
        );
        of_zip
    };
    let slice = Encoding::Explicit.file(&ct("0", 0));
    let two = [("a.nii", single.clone()), ("b.nii", single.clone())];
    assert!(matches!(
        refuse(&two),
        VolumeError::NotOneVolume { held, .. } if held == "2 NIfTI files (a.nii, b.nii)"
    ));
    let mixed = [("a.nii", single.clone()), ("b.dcm", slice.clone())];
    assert!(matches!(refuse(&mixed), VolumeError::NotOneVolume { .. }));
    let pairs = [
        ("a.hdr", header.clone()),
        ("a.img", image.clone()),
        ("b.dcm", slice),
    ];
    assert!(matches!(refuse(&pairs), VolumeError::NotOneVolume { .. }));
    let alone = [("a.hdr", header.clone()), ("LOCKFILE", Vec::new())];
    assert!(matches!(refuse(&alone), VolumeError::ImageMissing { .. }));
    let which = [
        ("c.hdr", header),
        ("a.img", image.clone()),
        ("b.img", image),
    ];
    assert!(matches!(refuse(&which), VolumeError::NotOneVolume { .. }));
    let none = company();
    assert!(matches!(refuse(&none), VolumeError::Unsupported { .. }));
    // A packed file that was cut off is no company.
    let mut cut = gzip(&single);
    cut.truncate(cut.len() / 2);
    let cut = [("a.nii.gz", cut), ("LOCKFILE", Vec::new())];
    assert!(matches!(
        refuse(&cut),
        VolumeError::Truncated { .. } | VolumeError::Corrupt { .. }
    ));
}

/// An object of that SOP class without pixels.
fn other(class: &'static str, modality: &'static str) -> Elements {
    BTreeMap::from([
        ((0x08, 0x16), ("UI", Text(class))),
        ((0x08, 0x60), ("CS", Text(modality))),
        ((0x20, 0x0e), ("UI", Text("1.2.3.9"))),
    ])
}

/// Objects that hold no slices: presentation states, reports, key objects, captures, raw data, ...
fn without_slices() -> Vec<(&'static str, Vec<u8>)> {
    let explicit = |elements: &Elements| Encoding::Explicit.file(elements);
    let mut planar = slices();
    planar.insert(
        (0x08, 0x08),
        ("CS", Text("ORIGINAL\\PRIMARY\\TOMO\\EMISSION")),
    );
    let mut localizer = ct("0", 0);
    localizer.insert((0x08, 0x08), ("CS", Text("ORIGINAL\\PRIMARY\\LOCALIZER")));
    let mut capture = ct("0", 0);
    capture.insert((0x08, 0x16), ("UI", Text("1.2.840.10008.5.1.4.1.1.7")));
    // A film, in a transfer syntax that is not read.
    let class = BTreeMap::from([((2, 2), ("UI", Text("1.2.840.10008.5.1.4.1.1.77.1.4.1\0")))]);
    let syntax = BTreeMap::from([((2, 0x10), ("UI", Text("1.2.840.10008.1.2.4.100\0")))]);
    let mut film = vec![0; 128];
    film.extend(b"DICM");
    film.extend(Encoding::Explicit.elements(&class));
    film.extend(Encoding::Explicit.elements(&syntax));
    vec![
        (
            "o/PR",
            explicit(&other("1.2.840.10008.5.1.4.1.1.11.1", "PR")),
        ),
        (
            "o/SR",
            explicit(&other("1.2.840.10008.5.1.4.1.1.88.67", "SR")),
        ),
        (
            "o/KO",
            explicit(&other("1.2.840.10008.5.1.4.1.1.88.59", "KO")),
        ),
        (
            "o/RAW",
            explicit(&other("1.2.840.10008.5.1.4.1.1.66", "NM")),
        ),
        (
            "o/PDF",
            explicit(&other("1.2.840.10008.5.1.4.1.1.104.1", "DOC")),
        ),
        (
            "o/RT",
            explicit(&other("1.2.840.10008.5.1.4.1.1.481.3", "RTSTRUCT")),
        ),
        ("o/OWN", explicit(&other("1.2.3.4.5.6", "OT"))),
        ("o/SC", explicit(&capture)),
        ("o/TOMO", explicit(&planar)),
        ("o/SCOUT", explicit(&localizer)),
        ("o/FILM", film),
    ]
}

#[test]
fn objects_without_slices_are_left_out_beside_a_volume() {
    let series = [ct("0", 0), ct("3", 6), ct("6", 12)];
    let whole = [slices()];
    for volume in [&series[..], &whole] {
        let names = ["v/1", "v/2", "v/3"];
        let bytes = volume
            .iter()
            .map(|elements| Encoding::Explicit.file(elements));
        let volume: Vec<_> = names.into_iter().zip(bytes).collect();
        let plain: Vec<_> = volume
            .iter()
            .map(|(name, bytes)| VolumeFile::in_memory(*name, bytes.clone()))
            .collect();
        let expected = read_files(&plain).unwrap();
        let about = |reading: &Reading, name: &str| {
            let warnings = &reading.facts.warnings;
            warnings.iter().filter(|w| w.contains(name)).count()
        };
        for (name, bytes) in without_slices() {
            let both: Vec<_> = volume.iter().cloned().chain([(name, bytes)]).collect();
            let (_kept, files) = folder(&both);
            for files in [files, vec![archive(&both, CompressionMethod::Deflated)]] {
                let reading = read_files(&files).unwrap();
                assert_eq!(reading.volume.voxels, expected.volume.voxels, "{name}");
                assert_eq!(about(&reading, name), 1, "{:?}", reading.facts.warnings);
            }
        }
        let all: Vec<_> = without_slices()
            .into_iter()
            .chain(company())
            .chain(volume)
            .collect();
        let reading = read_files(&[archive(&all, CompressionMethod::Stored)]).unwrap();
        assert_eq!(reading.volume.voxels, expected.volume.voxels);
        assert_eq!(reading.provenance, expected.provenance);
        let more = without_slices().len() - 8;
        assert_eq!(about(&reading, "A file was left out"), 8);
        assert_eq!(about(&reading, &format!("{more} more files")), 1);
    }
    // Where there is nothing else, the first one is refused by its name.
    let only = [
        &other("1.2.840.10008.5.1.4.1.1.11.1", "PR"),
        &other("1.2.840.10008.5.1.4.1.1.88.67", "SR"),
    ];
    let refused = read_files(&files(&only.map(Clone::clone))).unwrap_err();
    assert!(
        matches!(&refused, VolumeError::NotVolume { found, .. } if found.contains("Presentation State"))
    );
    // A slice that is damaged is no company.
    let mut cut = Encoding::Explicit.file(&ct("3", 0));
    cut.truncate(cut.len() - 4);
    let first = Encoding::Explicit.file(&ct("0", 0));
    let damaged = [("a", first), ("b", cut)];
    let refused = read_files(&[archive(&damaged, CompressionMethod::Stored)]).unwrap_err();
    assert!(
        !matches!(refused, VolumeError::NotVolume { .. }),
        "{refused:?}"
    );
}

#[test]
fn folders_are_bounded_and_links_are_not_followed() {
    let empty = tempfile::tempdir().unwrap();
    let refused = |path: &Path| VolumeFile::given(&[path], &ReadLimits::DEFAULT).unwrap_err();
    assert!(matches!(refused(empty.path()), VolumeError::Empty { .. }));
    let deep = tempfile::tempdir().unwrap();
    let levels: Vec<String> = (0..17).map(|level| level.to_string()).collect();
    fs::create_dir_all(deep.path().join(levels.join("/"))).unwrap();
    assert!(matches!(
        refused(deep.path()),
        VolumeError::TooLarge { what: "levels", .. }
    ));
    #[cfg(unix)]
    {
        let looped = tempfile::tempdir().unwrap();
        fs::write(
            looped.path().join("scan"),
            Encoding::Explicit.file(&slices()),
        )
        .unwrap();
        std::os::unix::fs::symlink(looped.path(), looped.path().join("again")).unwrap();
        let files = VolumeFile::given(&[looped.path()], &ReadLimits::DEFAULT).unwrap();
        assert_eq!(files.len(), 1);
        assert!(read_files(&files).is_ok());
    }
    let limited = |files, folder_levels| ReadLimits {
        files,
        folder_levels,
        ..ReadLimits::DEFAULT
    };
    let given = |limits| VolumeFile::given(&[deep.path()], &limits);
    assert!(matches!(
        given(limited(16, 18)),
        Err(VolumeError::TooLarge {
            what: "files",
            limit: 16,
            ..
        })
    ));
    assert!(matches!(
        given(limited(17, 18)),
        Err(VolumeError::Empty { .. })
    ));
}

#[test]
fn an_archive_is_not_believed_about_sizes() {
    let (single, voxels) = nifti();
    let content = [("scan.nii.gz", gzip(&single))];
    let archive = archive(&content, CompressionMethod::Deflated);
    let limits = ReadLimits {
        unpacked_bytes: 1000,
        ..ReadLimits::default()
    };
    let options = ReadOptions::default();
    let small = read_volume(
        std::slice::from_ref(&archive),
        &options,
        &limits,
        &Monitor::silent(),
    );
    assert!(
        matches!(small, Err(VolumeError::TooLarge { .. })),
        "{small:?}"
    );
    assert_eq!(read_files(&[archive]).unwrap().volume.voxels, voxels);
}
