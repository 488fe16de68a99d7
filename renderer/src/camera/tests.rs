//! Rays, importance and projection belong together.

use super::*;
use crate::math::{DAffine3, Frame};
use crate::sampling::{IndependentSampler, Sampler};
use statcheck::{Mean, sidak};

const SIZE: (u32, u32) = (640, 360);

/// A pinhole and a thin lens, turned and moved.
fn cameras() -> Vec<Camera> {
    let turn = glam::DQuat::from_euler(glam::EulerRot::YXZ, 0.7, -0.3, 0.2);
    let to_world = DAffine3::from_scale_rotation_translation(DVec3::splat(3.0), turn, DVec3::new(1.0, -2.0, 0.5));
    let pinhole = CameraDesc { to_world, fov: 60.0, ..CameraDesc::default() };
    let lens = CameraDesc { aperture_radius: 0.3, focus_distance: 2.5, ..pinhole.clone() };
    [pinhole, lens].iter().map(|desc| Camera::new(desc, SIZE.0, SIZE.1).unwrap()).collect()
}

fn raster(s: &mut IndependentSampler) -> Vec2 {
    s.next_2d() * Vec2::new(SIZE.0 as f32, SIZE.1 as f32) * 1.4 - Vec2::new(100.0, 60.0)
}

#[test]
fn projecting_a_ray_gives_its_raster_position() {
    let mut s = IndependentSampler::new([20]);
    for camera in cameras() {
        for _ in 0..5000 {
            let at = raster(&mut s);
            let ray = camera.generate_ray(at, s.next_2d());
            assert!((ray.d.length() - 1.0).abs() < 1e-6);
            let by_direction = camera.project_direction(ray.d, ray.o).unwrap();
            assert!((by_direction - at).abs().max_element() < 1e-4, "{at} {by_direction}");
            let inside = at.min_element() >= 0.0 && at.x < SIZE.0 as f32 && at.y < SIZE.1 as f32;
            assert_eq!(camera.shows(at), inside, "{at}");
            // Points far along the ray, so that their own rounding does not count.
            let by_point = camera.project(ray.at(100.0), ray.o).unwrap();
            assert!((by_point - at).abs().max_element() < 1e-3, "{at} {by_point}");
            assert!(camera.project_direction(-ray.d, ray.o).is_none());
            assert!(camera.project(ray.at(-1.0), ray.o).is_none());
        }
    }
}

/// Over the directions and lens points of one pixel, `We cos` integrates to one.
#[test]
fn importance_of_a_pixel_is_one() {
    let pixels = [(0u32, 0u32), (320, 180), (600, 20)];
    for camera in cameras() {
        for (i, &(x, y)) in pixels.iter().enumerate() {
            // A point of the lens, then a direction uniform in a cone that holds the pixel as seen from there.
            let centre = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let omc_max = (0.5 * camera.pixel * camera.pixel) as f32;
            let mut s = IndependentSampler::new([21, i as u64]);
            let mut mean = Mean::default();
            for _ in 0..50_000 {
                let Ray { o: lens, d: axis, .. } = camera.generate_ray(centre, s.next_2d());
                let w = Frame::from_normal(axis).to_world(warp::uniform_cone(s.next_2d(), omc_max));
                let inside = camera.project_direction(w, lens).is_some_and(|r| (r - centre).abs().max_element() < 0.5);
                let pdf = camera.lens_density() * f64::from(warp::uniform_cone_pdf(omc_max));
                mean.push(if inside { f64::from(camera.importance(w)) * camera.cos(w) / pdf } else { 0.0 });
            }
            assert!(mean.p_value(1.0, 1e-4) > sidak(0.01, 6), "{x} {y}: {mean:?}");
            assert!(mean.error() < 0.02);
        }
    }
}

/// A plane with a pattern, seen by rays from the camera and carried to the camera from its points: the same pixel.
#[test]
fn splats_and_rays_agree() {
    let radiance = |x: f32, y: f32| 1.0 + 0.8 * crate::math::sin(7.0 * x) * crate::math::cos(5.0 * y);
    let normal = Vec3::new(0.3, -0.2, 1.0).normalize();
    let frame = Frame::from_normal(normal);
    for (c, mut desc) in [CameraDesc::default(), CameraDesc::default()].into_iter().enumerate() {
        desc.fov = 50.0;
        if c == 1 {
            // Out of focus: the plane is at about 2.
            (desc.aperture_radius, desc.focus_distance) = (0.25, 3.0);
        }
        let camera = Camera::new(&desc, 8, 6).unwrap();
        let centre = Vec3::new(0.1, 0.0, -2.0);
        let mut s = IndependentSampler::new([22, c as u64]);
        let n = 400_000u32;
        let (mut by_rays, mut by_splats) = (vec![Mean::default(); 48], vec![Mean::default(); 48]);
        for (pixel, mean) in by_rays.iter_mut().enumerate() {
            for _ in 0..10_000 {
                let at = Vec2::new((pixel % 8) as f32, (pixel / 8) as f32) + s.next_2d();
                let ray = camera.generate_ray(at, s.next_2d());
                let q = ray.at((centre - ray.o).dot(normal) / ray.d.dot(normal)) - centre;
                mean.push(f64::from(radiance(q.dot(frame.s), q.dot(frame.t))));
            }
        }
        // Each point counts in one pixel of a box filter; in the others it is a zero.
        let mut counts = [0u32; 48];
        for _ in 0..n {
            let side = 6.0f32;
            let uv = (s.next_2d() - 0.5) * side;
            let p = centre + frame.s * uv.x + frame.t * uv.y;
            let Some(we) = camera.sample_we(p, s.next_2d()) else { continue };
            assert!((we.wi.length() - 1.0).abs() < 1e-6 && we.n.dot(we.wi) < 0.0);
            assert!(((we.lens.p - p).length() / we.dist - 1.0).abs() < 1e-5);
            assert!((we.we / camera.importance(-we.wi) - 1.0).abs() < 1e-5);
            if we.raster.x >= 0.0 && we.raster.x < 8.0 && we.raster.y >= 0.0 && we.raster.y < 6.0 {
                let pixel = we.raster.y as usize * 8 + we.raster.x as usize;
                let value = radiance(uv.x, uv.y) * we.we * we.wi.dot(normal).abs() / we.pdf;
                by_splats[pixel].push(f64::from(value * side * side));
                counts[pixel] += 1;
            }
        }
        for pixel in 0..48 {
            for _ in counts[pixel]..n {
                by_splats[pixel].push(0.0);
            }
            let p = by_rays[pixel].p_value_same(&by_splats[pixel], 1e-5);
            assert!(p > sidak(0.01, 96), "camera {c}, pixel {pixel}: {:?} {:?}", by_rays[pixel], by_splats[pixel]);
        }
    }
}

/// `pdf_we` is the density of the rays of uniform raster positions: `We cos` over the number of pixels, and it integrates to one.
#[test]
fn ray_densities() {
    for camera in cameras() {
        let mut s = IndependentSampler::new([23]);
        let mut mean = Mean::default();
        let frame = Frame::from_normal(camera.forward());
        for _ in 0..100_000 {
            let w = frame.to_world(warp::uniform_hemisphere(s.next_2d()));
            let (pdf_pos, pdf_dir) = camera.pdf_we(w);
            let expected = f64::from(camera.importance(w)) * camera.cos(w) / f64::from(SIZE.0 * SIZE.1);
            assert!((f64::from(pdf_pos * pdf_dir) / expected - 1.0).abs() < 1e-5);
            let lens = camera.position.as_vec3();
            let seen = camera
                .project_direction(w, lens)
                .is_some_and(|r| r.x >= 0.0 && r.y >= 0.0 && r.x < SIZE.0 as f32 && r.y < SIZE.1 as f32);
            mean.push(if seen { f64::from(pdf_dir / warp::UNIFORM_HEMISPHERE_PDF) } else { 0.0 });
        }
        assert_eq!(camera.pdf_we(-camera.forward()).1, 0.0);
        // From a lens point off the axis the picture is shifted; the axis will do.
        assert!(mean.p_value(1.0, 1e-5) > 0.001, "{mean:?}");
    }
}

#[test]
fn axes_and_angles_of_view() {
    let (w, h) = (640.0f32, 360.0f32);
    let edge = |fov_axis, at: Vec2| {
        let desc = CameraDesc { fov: 90.0, fov_axis, ..CameraDesc::default() };
        let d = Camera::new(&desc, 640, 360).unwrap().generate_ray(at, Vec2::ZERO).d;
        d / -d.z
    };
    let near = |a: Vec3, b: Vec3| assert!((a - b).length() < 1e-5, "{a} {b}");
    near(edge(FovAxis::Y, Vec2::new(w / 2.0, 0.0)), Vec3::new(0.0, 1.0, -1.0));
    near(edge(FovAxis::Smaller, Vec2::new(w / 2.0, h)), Vec3::new(0.0, -1.0, -1.0));
    near(edge(FovAxis::X, Vec2::new(w, h / 2.0)), Vec3::new(1.0, 0.0, -1.0));
    near(edge(FovAxis::Larger, Vec2::new(0.0, h / 2.0)), Vec3::new(-1.0, 0.0, -1.0));
    assert!((edge(FovAxis::Diagonal, Vec2::new(0.0, 0.0)).truncate().length() - 1.0).abs() < 1e-5);
    // A mirrored camera mirrors the picture; scale does nothing.
    let to_world = DAffine3::from_scale(DVec3::new(-5.0, 0.1, 2.0));
    let mirrored = Camera::new(&CameraDesc { to_world, ..CameraDesc::default() }, 10, 10).unwrap();
    let plain = Camera::new(&CameraDesc::default(), 10, 10).unwrap();
    let (a, b) =
        (mirrored.generate_ray(Vec2::new(1.0, 3.0), Vec2::ZERO), plain.generate_ray(Vec2::new(1.0, 3.0), Vec2::ZERO));
    assert_eq!(a.d * Vec3::new(-1.0, 1.0, 1.0), b.d);
}

#[test]
fn refused() {
    let good = CameraDesc::default();
    let is = |desc: CameraDesc, error| assert_eq!(Camera::new(&desc, 10, 10).unwrap_err(), error);
    is(CameraDesc { fov: 180.0, ..good.clone() }, CameraError::Fov);
    is(CameraDesc { fov: f64::NAN, ..good.clone() }, CameraError::Fov);
    is(CameraDesc { aperture_radius: -1.0, ..good.clone() }, CameraError::Lens);
    is(CameraDesc { focus_distance: 0.0, ..good.clone() }, CameraError::Lens);
    is(
        CameraDesc { to_world: DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0)), ..good.clone() },
        CameraError::Transform,
    );
    is(CameraDesc { to_world: DAffine3::from_translation(DVec3::X * 1e300), ..good.clone() }, CameraError::Transform);
    assert_eq!(Camera::new(&good, 0, 10).unwrap_err(), CameraError::Size);
}
