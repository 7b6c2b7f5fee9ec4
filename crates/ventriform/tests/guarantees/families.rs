//! Families of random surfaces. A seed always gives the same surface.
//!
//! Nearly all are made by Marching Cubes, as those of real scans are.

use rand::{Rng, RngExt};
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::geometry::random::{Purpose, stream};
use ventriform::base::progress::Monitor;
use ventriform::image::volume::Volume;
use ventriform::image::volume::phantom::{PhantomParameters, phantom};
use ventriform::mesh::{TriMesh, shapes};
use ventriform::surface::{
    IsoLevel, Isolate, Surface, SurfaceParameters, TopologyMode, extract, from_mesh,
};

/// Iso-value of the fields below. Most of them grow by 1 per millimetre towards the inside.
const ISO_LEVEL: f64 = 50.0;

fn between(random: &mut impl Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * random.random::<f64>()
}

fn direction(random: &mut impl Rng) -> Vec3 {
    loop {
        let v = Vec3::from_fn(|_, _| between(random, -1.0, 1.0));
        if (0.1..1.0).contains(&v.norm()) {
            return v.normalize();
        }
    }
}

fn volume(shape: [usize; 3], spacing: f64, value: impl Fn(Vec3) -> f64) -> Volume {
    let frame = VoxelToPatient::centred(shape, [spacing; 3], Vec3::zeros()).unwrap();
    Volume::sampled(shape, frame, |p| value(*p))
}

/// The surface at [`ISO_LEVEL`] of the components that `isolate` keeps, with all handles.
fn kept(volume: &Volume, isolate: Isolate) -> Surface {
    let parameters = SurfaceParameters {
        iso: IsoLevel::Absolute(ISO_LEVEL),
        isolate,
        topology: TopologyMode::Keep,
        ..SurfaceParameters::default()
    };
    extract(volume, &parameters, &Monitor::silent()).unwrap()
}

/// Simulated scans of different noise, resolution, wall thickness and pose.
pub fn phantoms(seed: u64) -> Surface {
    let mut random = stream(seed, Purpose::PhantomShape);
    let spacing = between(&mut random, 4.0, 6.5);
    let parameters = PhantomParameters {
        shape: [(230.0 / spacing) as usize; 3],
        spacing_mm: [spacing; 3],
        wall_mm: between(&mut random, 8.0, 14.0),
        noise: between(&mut random, 0.01, 0.15),
        fwhm_mm: between(&mut random, 8.0, 15.0),
        pose_spread_deg: 90.0,
        seed,
        ..PhantomParameters::default()
    };
    let made = phantom(&parameters, &Monitor::silent()).unwrap();
    extract(
        &made.volume,
        &SurfaceParameters::default(),
        &Monitor::silent(),
    )
    .unwrap()
}

/// Smooth star-shaped surfaces, from nearly round to deeply lobed.
pub fn organs(seed: u64) -> Surface {
    let mut random = stream(seed, Purpose::PhantomShape);
    let waves: Vec<(Vec3, f64)> = (0..8)
        .map(|_| {
            let k = direction(&mut random) * between(&mut random, 1.0, 4.0);
            (k, between(&mut random, 0.0, 6.3))
        })
        .collect();
    let depth = between(&mut random, 0.02, 0.12);
    let mut mesh: TriMesh = shapes::icosphere(30.0, 3 + (seed % 2) as u32);
    for v in &mut mesh.vertices {
        let n = v.normalize();
        let bumps: f64 = waves.iter().map(|(k, p)| (k.dot(&n) + p).sin()).sum();
        *v *= (1.0 + depth * bumps).max(0.2);
    }
    from_mesh(mesh, 2.0).unwrap()
}

/// Sums of two to seven Gaussian blobs.
pub fn metaballs(seed: u64) -> Surface {
    let mut random = stream(seed, Purpose::PhantomShape);
    let balls: Vec<(Vec3, f64)> = (0..2 + seed % 6)
        .map(|_| {
            let centre = direction(&mut random) * between(&mut random, 0.0, 22.0);
            (centre, between(&mut random, 7.0, 15.0))
        })
        .collect();
    let field = volume([30; 3], 3.0, |p| {
        let heat = |(c, r): &(Vec3, f64)| (-((p - c).norm() / r).powi(2)).exp();
        ISO_LEVEL - 0.4 + balls.iter().map(heat).sum::<f64>()
    });
    kept(&field, Isolate::Largest)
}

/// Chains of one to four tilted rings, thick or thin: genus 1 to 4.
pub fn rings(seed: u64) -> Surface {
    let mut random = stream(seed, Purpose::PhantomShape);
    let count = 1 + seed % 4;
    let (radius, tube) = (
        between(&mut random, 12.0, 16.0),
        between(&mut random, 3.5, 7.0),
    );
    let tilts: Vec<f64> = (0..count)
        .map(|_| between(&mut random, -0.5, 0.5))
        .collect();
    let extent = (2.0 * radius * count as f64 + 4.0 * tube) / 2.5;
    let field = volume([extent as usize + 4, 22, 20], 2.5, |p| {
        let nearest = |i: usize| {
            let middle = 2.0 * radius * (i as f64 - (count - 1) as f64 / 2.0);
            let q = p - Vec3::x() * middle;
            let (sin, cos) = tilts[i].sin_cos();
            let q = Vec3::new(q.x, cos * q.y - sin * q.z, sin * q.y + cos * q.z);
            (q.xy().norm() - radius).hypot(q.z)
        };
        ISO_LEVEL + tube
            - (0..count as usize)
                .map(nearest)
                .fold(f64::INFINITY, f64::min)
    });
    let surface = kept(&field, Isolate::None);
    assert_eq!(
        surface.facts.genus, count as i64,
        "the rings of seed {seed}"
    );
    surface
}

/// Bowls with a wall of one to two voxels. Every third one is a mask.
pub fn thin_sheets(seed: u64) -> Surface {
    let mut random = stream(seed, Purpose::PhantomShape);
    let spacing = 3.0;
    let wall = between(&mut random, 1.0, 2.0) * spacing;
    let (radius, stretch) = (
        between(&mut random, 22.0, 34.0),
        between(&mut random, 0.7, 1.3),
    );
    let open = between(&mut random, 0.1, 0.8) * radius;
    let up = direction(&mut random);
    let mut field = volume([32; 3], spacing, |p| {
        let along = p.dot(&up);
        let q = (p - up * along).norm().hypot(along * stretch);
        ISO_LEVEL + (wall / 2.0 - (q - radius).abs()).min(open - along)
    });
    if !seed.is_multiple_of(3) {
        return kept(&field, Isolate::Largest);
    }
    for v in &mut field.voxels {
        *v = f32::from(u8::from(*v >= ISO_LEVEL as f32));
    }
    field.integral = true;
    let parameters = SurfaceParameters::default();
    extract(&field, &parameters, &Monitor::silent()).unwrap()
}

/// Smoothed noise, cut at a level: many handles, cavities and small components.
pub fn noise(seed: u64) -> Surface {
    let mut random = stream(seed, Purpose::PhantomNoise);
    let n = 10 + (seed % 5) as usize;
    let mut field = volume([n; 3], 3.0, |_| 0.0);
    for v in &mut field.voxels {
        *v = random.random::<f32>() - 0.5;
    }
    for _ in 0..2 + seed % 3 {
        let old = field.clone();
        for at in 0..field.voxels.len() {
            let [i, j, k] = [at % n, at / n % n, at / n / n];
            let (mut sum, mut count) = (0.0, 0.0);
            for (a, b, c) in [
                (0, 0, 0),
                (1, 0, 0),
                (2, 1, 1),
                (1, 2, 1),
                (1, 1, 0),
                (1, 1, 2),
            ] {
                let (a, b, c) = (i + a, j + b, k + c);
                if (1..=n).contains(&a) && (1..=n).contains(&b) && (1..=n).contains(&c) {
                    sum += old.at(a - 1, b - 1, c - 1);
                    count += 1.0;
                }
            }
            field.voxels[at] = sum / count;
        }
    }
    let mut sorted = field.voxels.clone();
    sorted.sort_by(f32::total_cmp);
    let share = between(&mut random, 0.5, 0.8);
    let level = sorted[(share * sorted.len() as f64) as usize];
    for v in &mut field.voxels {
        *v = *v - level + ISO_LEVEL as f32;
    }
    let isolate = [Isolate::Largest, Isolate::None][(seed % 2) as usize];
    kept(&field, isolate)
}

/// Two to five balls, rings and hollow shells, apart from one another. Each shell contains a ball.
pub fn several(seed: u64) -> Surface {
    let mut random = stream(seed, Purpose::PhantomShape);
    let kinds: Vec<(Vec3, f64, u64)> = (0..2 + seed % 4)
        .map(|i| {
            let centre = Vec3::x() * (34.0 * i as f64) + direction(&mut random) * 3.0;
            (
                centre,
                between(&mut random, 5.0, 13.0),
                random.random_range(0..3),
            )
        })
        .collect();
    let long = (34.0 * kinds.len() as f64 / 2.0) as usize + 4;
    let half = 17.0 * (kinds.len() - 1) as f64;
    let field = volume([long, 18, 18], 2.0, |p| {
        let p = p + Vec3::x() * half;
        let inward = |(c, r, kind): &(Vec3, f64, u64)| {
            let q = p - c;
            match kind {
                0 => r - q.norm(),
                1 => 3.2 - (q.xy().norm() - r.max(7.0)).hypot(q.z),
                // A shell, and a ball in its cavity.
                _ => (2.5 - (q.norm() - 10.0).abs()).max(3.0 - q.norm()),
            }
        };
        ISO_LEVEL + kinds.iter().map(inward).fold(f64::NEG_INFINITY, f64::max)
    });
    kept(&field, Isolate::None)
}

/// Rough solids that do not come from a voxel grid, stretched and curved.
pub fn rough(seed: u64) -> Surface {
    let mut random = stream(seed, Purpose::PhantomShape);
    let mut mesh = match seed % 3 {
        0 => shapes::icosphere(20.0, 3),
        1 => shapes::torus(30.0, between(&mut random, 6.0, 20.0), 48, 20),
        _ => {
            let wall = between(&mut random, 4.0, 14.0);
            shapes::cup(between(&mut random, 30.0, 80.0), 30.0, wall, 36)
        }
    };
    let stretch = Vec3::from_fn(|_, _| between(&mut random, 0.5, 1.5));
    let (bend, reach) = (
        between(&mut random, 0.0, 0.01),
        between(&mut random, 0.0, 0.3),
    );
    for v in &mut mesh.vertices {
        v.component_mul_assign(&stretch);
        v.x += bend * v.z * v.z;
        *v += Vec3::from_fn(|_, _| between(&mut random, -reach, reach));
    }
    from_mesh(mesh, 1.0).unwrap()
}
