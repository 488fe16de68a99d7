//! How the time of a ray and the build grow with the number of triangles.

use super::{room_subject, sets, timed};
use crate::report::growth::fit::exponent;
use renderer::accel::Accel;
use serde::Serialize;
use std::fmt;

/// One room.
#[derive(Debug, Serialize)]
struct Point {
    triangles: usize,
    build_s: f64,
    bytes_per_triangle: f64,
    /// Nanoseconds per ray: camera, second bounce, occlusion on the second bounce.
    camera_ns: f64,
    bounce_ns: f64,
    occlusion_ns: f64,
}

/// Rooms of growing size, and the exponents of `time = a n^b` fitted by least squares of the logarithms.
#[derive(Debug, Serialize)]
pub struct Growth {
    points: Vec<Point>,
    camera_exponent: f64,
    bounce_exponent: f64,
    occlusion_exponent: f64,
    build_exponent: f64,
}

/// Triangles of the rooms.
const SIZES: [usize; 9] = [1000, 3000, 10_000, 30_000, 100_000, 300_000, 1_000_000, 3_000_000, 10_000_000];

/// Times the rooms.
pub fn measure(runs: usize) -> Result<Growth, String> {
    let points = SIZES.iter().map(|&n| point(n, runs)).collect::<Result<Vec<_>, _>>()?;
    let fit = |of: fn(&Point) -> f64| {
        let pairs: Vec<(f64, f64)> = points.iter().map(|p| (p.triangles as f64, of(p))).collect();
        exponent(&pairs).map_or(f64::NAN, |e| e.value)
    };
    Ok(Growth {
        camera_exponent: fit(|p| p.camera_ns),
        bounce_exponent: fit(|p| p.bounce_ns),
        occlusion_exponent: fit(|p| p.occlusion_ns),
        build_exponent: fit(|p| p.build_s),
        points,
    })
}

fn point(triangles: usize, runs: usize) -> Result<Point, String> {
    let subject = room_subject(triangles);
    let (accel, build_s) = timed(|| Accel::build(&subject.geometry));
    let accel = accel.map_err(|e| e.to_string())?;
    let count = subject.geometry.meshes[0].triangles.len();
    let sets = sets::all(&subject.geometry, &accel, subject.camera);
    let ns = |name: &str| -> Result<f64, String> {
        let set = sets.iter().find(|s| s.name == name).ok_or("no such set of rays")?;
        Ok(1e3 / super::rate(set, runs, &accel, |_| Ok(None))?.ours)
    };
    Ok(Point {
        triangles: count,
        build_s,
        bytes_per_triangle: accel.bytes() as f64 / count as f64,
        camera_ns: ns("camera")?,
        bounce_ns: ns("bounce 2")?,
        occlusion_ns: ns("occlusion, bounce 2")?,
    })
}

impl fmt::Display for Growth {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "triangles   build s  bytes/tri   ns: camera  bounce 2  occlusion")?;
        for p in &self.points {
            writeln!(
                f,
                "{:9}  {:8.3}  {:9.1}   {:10.1}  {:8.1}  {:9.1}",
                p.triangles, p.build_s, p.bytes_per_triangle, p.camera_ns, p.bounce_ns, p.occlusion_ns
            )?;
        }
        write!(
            f,
            "exponent   {:8.3}              {:10.3}  {:8.3}  {:9.3}",
            self.build_exponent, self.camera_exponent, self.bounce_exponent, self.occlusion_exponent
        )
    }
}
