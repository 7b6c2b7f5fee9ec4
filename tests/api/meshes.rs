//! Meshes, archives and odd volumes over HTTP, with the real computation: templates and experts from every format,
//! files beside a series, single slices.

use crate::dicom::{JANE, element, file, nm};
use crate::helpers::{Service, heart, mesh_json, problem, scan, text};
use crate::scu;
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::Value;
use std::io::{Cursor, Write as _};
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::image::grid::voxelise::voxelise;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::{self, ReadLimits, ReadOptions, Volume, VolumeFile};
use ventriform::mesh::{TriMesh, shapes};
use ventriform::results::export::{self, Format, Metadata};

/// A cup as a heart's wall; its coordinates are exact in single precision.
fn cup() -> TriMesh {
    let mut mesh = shapes::cup(70.0, 31.0, 13.0, 12);
    mesh.vertices
        .iter_mut()
        .for_each(|p| *p = p.map(|x| f64::from(x as f32)));
    mesh
}

/// An STL text of `mesh` without a word about unit and frame.
fn silent_stl(mesh: &TriMesh) -> Vec<u8> {
    let mut text = String::from("solid a heart\n");
    for t in 0..mesh.triangles.len() {
        text += "facet normal 0 0 0\nouter loop\n";
        for p in mesh.corners(t) {
            text += &format!("vertex {} {} {}\n", p.x, p.y, p.z);
        }
        text += "endloop\nendfacet\n";
    }
    (text + "endsolid\n").into_bytes()
}

async fn json(service: &Service, path: &str) -> Value {
    let answer = service.get(path).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::OK, "{path}");
    answer.json().await.unwrap()
}

#[tokio::test]
async fn a_template_is_the_same_in_whatever_format_it_comes() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let post = |query: &str, media_type: &str, body: Vec<u8>| {
        service
            .post(&format!("/v1/templates{query}"))
            .header("content-type", media_type)
            .body(body)
            .send()
    };
    let mesh = cup();
    let added = post("", "application/json", mesh_json(&mesh))
        .await
        .unwrap();
    assert_eq!(added.status(), StatusCode::CREATED);
    let first: Value = added.json().await.unwrap();
    assert_eq!(first["summary"]["warnings"], serde_json::json!([]));
    assert_eq!(first["software"]["name"], "ventriform");
    for format in Format::ALL {
        let bytes = export::encode(format, &mesh, &Metadata::new("t")).unwrap();
        for media_type in [format.media_type(), "application/octet-stream"] {
            let again = post("", media_type, bytes.clone()).await.unwrap();
            let status = again.status();
            let body: Value = again.json().await.unwrap();
            // STL orders the vertices anew, which makes it another template.
            match format {
                Format::Stl => assert!(status.is_success(), "{body}"),
                _ => assert_eq!(
                    (status, &body),
                    (StatusCode::OK, &first),
                    "{}",
                    format.extension()
                ),
            }
            assert_eq!(body["summary"]["vertices"], first["summary"]["vertices"]);
            let [own, wanted] =
                [&body, &first].map(|b| b["summary"]["volume_ml"].as_f64().unwrap());
            assert!((own - wanted).abs() < 1e-3 * wanted, "{own} {wanted}");
        }
    }
    // What the file does not say is assumed and told, or stated. Another mesh, since the first is in the library.
    let mut mesh = mesh;
    mesh.vertices.iter_mut().for_each(|p| p.z += 1.0);
    let silent = post("", "model/stl", silent_stl(&mesh)).await.unwrap();
    let silent: Value = silent.json().await.unwrap();
    let warnings = silent["summary"]["warnings"].to_string();
    assert!(warnings.contains("LPS was assumed"), "{warnings}");
    let mut centimetres = mesh.clone();
    centimetres.vertices.iter_mut().for_each(|p| *p /= 10.0);
    let centimetres = silent_stl(&centimetres);
    let refused = post("", "model/stl", centimetres.clone()).await.unwrap();
    let refused = problem(refused, 422, "unsuitable-model").await;
    assert_eq!(refused["field"], "mesh_unit");
    assert!(text(&refused["fix"]).contains("by 10 "), "{refused}");
    let stated = post("?mesh_unit=cm&mesh_frame=lps", "model/stl", centimetres)
        .await
        .unwrap();
    assert_eq!(stated.status(), StatusCode::CREATED);
    let stated: Value = stated.json().await.unwrap();
    assert_eq!(stated["summary"]["warnings"], serde_json::json!([]));
    let against = post("?mesh_frame=ras", "application/json", mesh_json(&mesh))
        .await
        .unwrap();
    problem(against, 422, "contradiction").await;
    let wrong = post("?mesh_unit=inch", "application/json", mesh_json(&mesh))
        .await
        .unwrap();
    problem(wrong, 400, "invalid-parameter").await;
    let mut open = mesh.clone();
    open.triangles.pop();
    let open = post("", "model/stl", silent_stl(&open)).await.unwrap();
    let open = problem(open, 422, "unsuitable-model").await;
    assert!(text(&open["detail"]).contains("3 edges"), "{open}");
    let picture = post("", "image/png", b"\x89PNG".to_vec()).await.unwrap();
    problem(picture, 415, "unsupported-media-type").await;
}

/// The true wall's mask, as the surface of its voxels would draw it, is the same expert as a mesh.
#[tokio::test]
async fn an_expert_may_draw_a_mesh() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let (scan, truth) = heart();
    let (limits, quiet) = (ReadLimits::default(), Monitor::silent());
    let files = [VolumeFile::in_memory("truth.nii.gz", truth)];
    let truth = volume::read(&files, &ReadOptions::default(), &limits, &quiet)
        .unwrap()
        .volume;
    // A ball where the heart is: what matters is that it lies there in both files.
    let inside = truth.voxels.iter().enumerate().filter(|(_, v)| **v > 0.5);
    let [nx, ny, _] = truth.shape;
    let place = |v: usize| {
        let index = [v % nx, v / nx % ny, v / (nx * ny)].map(|x| x as f64);
        truth.frame.to_patient(&Vec3::from(index))
    };
    let places: Vec<Vec3> = inside.map(|(v, _)| place(v)).collect();
    let centre = places.iter().sum::<Vec3>() / places.len() as f64;
    let mut ball = shapes::icosphere(45.0, 3);
    ball.vertices.iter_mut().for_each(|p| *p += centre);
    let mask = voxelise(&ball, truth.shape, &truth.frame, &Monitor::silent()).unwrap();
    let as_volume = Volume {
        voxels: mask
            .voxels
            .iter()
            .map(|v| f32::from(u8::from(*v)))
            .collect(),
        ..truth.clone()
    };
    let as_volume = nifti::write(&as_volume, StoredType::Uint8, true).unwrap();
    let mut ras = ball.clone();
    ras.vertices
        .iter_mut()
        .for_each(|p| (p.x, p.y) = (-p.x, -p.y));
    let vtp = export::encode(Format::Vtp, &ball, &Metadata::new("t")).unwrap();
    let mut figures = Vec::new();
    for (name, expert, query) in [
        ("mask.nii.gz", as_volume, ""),
        ("drawn.vtp", vtp, ""),
        ("drawn.stl", silent_stl(&ras), "&mesh_frame=ras"),
    ] {
        let form = Form::new()
            .part("volume", Part::bytes(scan.clone()).file_name("scan.nii.gz"))
            .part("expert", Part::bytes(expert).file_name(name));
        let answer = service
            .post(&format!("/v1/segmentations?model=auto{query}"))
            .multipart(form)
            .send()
            .await
            .unwrap();
        assert_eq!(answer.status(), 202, "{name}");
        let job: Value = answer.json().await.unwrap();
        let job = service.ended(&text(&job["id"])).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        let made = json(&service, &text(&job["links"]["segmentation"])).await;
        let jaccard = made["summary"]["measures"]["jaccard"].as_f64();
        figures.push(jaccard.unwrap());
        // What the page lays over the scan.
        let expert = text(&made["parameters"]["expert"]);
        let overlay = format!("/v1/volumes/{expert}/voxels.nii.gz?mask=true{query}");
        let overlay = service.get(&overlay).send().await.unwrap();
        assert_eq!(overlay.status(), 200);
        let bytes = overlay.bytes().await.unwrap().to_vec();
        let shown = [VolumeFile::in_memory("shown.nii.gz", bytes)];
        let shown = volume::read(&shown, &ReadOptions::default(), &limits, &quiet)
            .unwrap()
            .volume;
        let centred = shown.frame.to_voxel(&centre).map(f64::round);
        let [i, j, k] = [0, 1, 2].map(|a| centred[a] as usize);
        assert_eq!(
            shown.voxels[i + shown.shape[0] * (j + shown.shape[1] * k)],
            1.0,
            "{name}"
        );
    }
    assert_eq!(figures[0], figures[1]);
    assert!((figures[0] - figures[2]).abs() < 1e-6, "{figures:?}");
    let stray = service
        .get("/v1/volumes/vol_00/voxels.nii.gz?label=2")
        .send()
        .await
        .unwrap();
    problem(stray, 422, "invalid-parameter").await;
}

/// A template and an expert's mesh may be sent under the same media types: the bytes are told by their content.
#[tokio::test]
async fn a_mesh_is_taken_under_each_of_its_media_types_by_both_collections() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let mesh = mesh_json(&cup());
    for media_type in [
        "application/json",
        "application/octet-stream",
        "text/plain",
        "application/xml",
        "text/xml",
        "model/stl",
        "model/x-ply",
        "model/x-obj",
        "model/x-vtk",
        "model/x-vtp",
        "model/gltf+json",
    ] {
        for collection in ["templates", "volumes"] {
            let answer = service
                .post(&format!("/v1/{collection}"))
                .header("content-type", media_type)
                .body(mesh.clone())
                .send()
                .await
                .unwrap();
            let status = answer.status();
            assert!(status.is_success(), "{media_type} {collection}: {status}");
        }
    }
}

/// Of a label map, the page shows the one structure that was compared.
#[tokio::test]
async fn the_structure_that_was_compared_can_be_downloaded_alone() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let frame = VoxelToPatient::centred([8; 3], [3.0; 3], Vec3::zeros()).unwrap();
    let label = |v: usize| f32::from(u8::from(v % 8 > 1)) * (1 + v / 256) as f32;
    let map = Volume {
        shape: [8; 3],
        voxels: (0..512).map(label).collect(),
        frame,
        integral: true,
    };
    let stored = nifti::write(&map, StoredType::Uint8, true).unwrap();
    let added = service
        .post("/v1/volumes")
        .body(stored)
        .send()
        .await
        .unwrap();
    let id = text(&added.json::<Value>().await.unwrap()["id"]);
    let (limits, quiet) = (ReadLimits::default(), Monitor::silent());
    for wanted in [1.0_f32, 2.0] {
        let path = format!("/v1/volumes/{id}/voxels.nii.gz?mask=true&label={wanted}");
        let answer = service.get(&path).send().await.unwrap();
        let bytes = answer.bytes().await.unwrap().to_vec();
        let shown = [VolumeFile::in_memory("shown.nii.gz", bytes)];
        let shown = volume::read(&shown, &ReadOptions::default(), &limits, &quiet)
            .unwrap()
            .volume;
        let alone: Vec<f32> = map
            .voxels
            .iter()
            .map(|v| f32::from(u8::from(*v == wanted)))
            .collect();
        assert_eq!(shown.voxels, alone);
    }
    let several = service
        .get(&format!("/v1/volumes/{id}/voxels.nii.gz?mask=true"))
        .send()
        .await
        .unwrap();
    problem(several, 422, "label-needed").await;
    let none = service
        .get(&format!("/v1/volumes/{id}/voxels.nii.gz?mask=true&label=9"))
        .send()
        .await
        .unwrap();
    problem(none, 422, "no-such-label").await;
}

/// An object of that SOP class without slices.
fn object(class: &str, modality: &str, number: usize) -> Vec<u8> {
    let below = |n: usize| format!("{}.9{number}.{n}", JANE.study).into_bytes();
    file(&[
        element(0x08, 0x16, "UI", class.as_bytes()),
        element(0x08, 0x18, "UI", &below(1)),
        element(0x08, 0x60, "CS", modality.as_bytes()),
        element(0x10, 0x10, "PN", JANE.name.as_bytes()),
        element(0x20, 0x0d, "UI", JANE.study.as_bytes()),
        element(0x20, 0x0e, "UI", &below(2)),
    ])
}

/// The files that lie beside a scan on a medium and in an export.
fn company() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("LOCKFILE", Vec::new()),
        ("DICOMDIR", object("1.2.840.10008.1.3.10", "", 1)),
        (
            "DICOM/SR000001",
            object("1.2.840.10008.5.1.4.1.1.88.11", "SR", 2),
        ),
        (
            "DICOM/PR000001",
            object("1.2.840.10008.5.1.4.1.1.11.1", "PR", 3),
        ),
        (
            "DICOM/KO000001",
            object("1.2.840.10008.5.1.4.1.1.88.59", "KO", 4),
        ),
        ("README.TXT", b"burnt by a workstation".to_vec()),
    ]
}

#[tokio::test]
async fn what_lies_beside_a_scan_is_left_out_of_zips_and_forms_alike() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let scan = nm(&JANE, 1);
    let alone = service
        .post("/v1/volumes")
        .body(scan.clone())
        .send()
        .await
        .unwrap();
    assert_eq!(alone.status(), StatusCode::CREATED);
    let alone: Value = alone.json().await.unwrap();

    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let mut form = Form::new();
    for (name, bytes) in company().into_iter().chain([("DICOM/NM000001", scan)]) {
        archive
            .start_file(name, zip::write::SimpleFileOptions::default())
            .unwrap();
        archive.write_all(&bytes).unwrap();
        // A browser sends empty files, too; the form refuses none.
        if !bytes.is_empty() {
            let plain = name.rsplit('/').next().unwrap();
            form = form.part("file", Part::bytes(bytes).file_name(plain));
        }
    }
    let archive = archive.finish().unwrap().into_inner();
    let zipped = service
        .post("/v1/volumes")
        .header("content-type", "application/zip")
        .body(archive)
        .send()
        .await
        .unwrap();
    let formed = service
        .post("/v1/volumes")
        .multipart(form)
        .send()
        .await
        .unwrap();
    for answer in [zipped, formed] {
        let status = answer.status();
        let body: Value = answer.json().await.unwrap();
        assert_eq!(status, StatusCode::CREATED, "{body}");
        for same in ["shape", "affine", "format", "frames", "intensity", "dicom"] {
            assert_eq!(body[same], alone[same], "{same}");
        }
        let warnings = body["warnings"].to_string();
        let said = warnings.matches("left out, since it holds no slices");
        // A directory of a medium among them, unless it lies in an archive.
        assert!((3..=4).contains(&said.count()), "{warnings}");
        assert!(!warnings.contains("Doe"), "{warnings}");
    }
    // Nothing but company is no scan.
    let mut only = Form::new();
    for (name, bytes) in company().into_iter().filter(|(_, bytes)| !bytes.is_empty()) {
        only = only.part("file", Part::bytes(bytes).file_name(name.replace('/', "_")));
    }
    let only = service
        .post("/v1/volumes")
        .multipart(only)
        .send()
        .await
        .unwrap();
    problem(only, 422, "unsupported-format").await;
}

#[tokio::test]
async fn a_single_slice_is_described_and_makes_no_model() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let shape = [40, 1, 40];
    let frame = VoxelToPatient::centred(shape, [4.0; 3], Vec3::zeros()).unwrap();
    let flat = Volume {
        shape,
        voxels: (0..1600).map(|v| (v % 37) as f32).collect(),
        frame,
        integral: true,
    };
    let flat = nifti::write(&flat, StoredType::Int16, true).unwrap();
    let one = scu::slice("1.2.3.4", 1).file();
    for slice in [flat, one] {
        let described = service
            .post("/v1/volumes")
            .body(slice.clone())
            .send()
            .await
            .unwrap();
        assert_eq!(described.status(), StatusCode::CREATED);
        for kind in ["models", "segmentations"] {
            let answer = service
                .post(&format!("/v1/{kind}"))
                .header("prefer", super::helpers::UNTIL_DONE)
                .body(slice.clone())
                .send()
                .await
                .unwrap();
            let refused = problem(answer, 422, "single-slice").await;
            assert!(text(&refused["fix"]).contains("all slices"), "{refused}");
        }
    }
    let whole = service
        .post("/v1/models?points=60")
        .header("prefer", super::helpers::UNTIL_DONE)
        .body(scan());
    assert!(whole.send().await.unwrap().status().is_success());
}
