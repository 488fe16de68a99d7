//! Small pictures of jobs. Made when asked for, one at a time, and kept for a while.

use crate::hub::Hub;
use crate::ids::JobId;
use bytes::Bytes;
use renderer::film::{exr, png};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use tokio::sync::Mutex;

/// The longest side of a preview in pixels.
const SIDE: u32 = 640;
/// A preview of a job that goes on is made anew after so long.
const FRESH: Duration = Duration::from_secs(3);
/// Previews kept.
const KEEP: usize = 64;

struct Kept {
    made: Instant,
    complete: bool,
    png: Bytes,
}

/// The previews.
#[derive(Default)]
pub struct Previews {
    kept: Mutex<BTreeMap<JobId, Kept>>,
}

impl Previews {
    /// The preview of a job.
    pub async fn get(&self, hub: &Hub, id: JobId) -> Result<Bytes, String> {
        // Held while one is made: a crowd that looks at the page costs no more than one viewer.
        let mut kept = self.kept.lock().await;
        if let Some(k) = kept.get(&id).filter(|k| k.complete || k.made.elapsed() < FRESH) {
            return Ok(k.png.clone());
        }
        let snapshot = hub.snapshot(id).await;
        let complete = snapshot.is_none();
        let path = hub.store.image_path(id);
        let work = move || match snapshot {
            Some(s) => small(s.image.width, s.image.height, &s.image.mean),
            None => {
                let bytes = std::fs::read(&path).map_err(|_| "this job has no image".to_string())?;
                let picture = exr::decode(&bytes)?;
                let pixels = picture.triple(["R", "G", "B"]).ok_or("the image has no R, G and B")?;
                small(picture.width, picture.height, &pixels)
            }
        };
        let png: Bytes = tokio::task::spawn_blocking(work).await.map_err(|e| e.to_string())??.into();
        if kept.len() >= KEEP
            && let Some(oldest) = kept.iter().min_by_key(|(_, k)| k.made).map(|(id, _)| *id)
        {
            kept.remove(&oldest);
        }
        kept.insert(id, Kept { made: Instant::now(), complete, png: png.clone() });
        Ok(png)
    }
}

/// A PNG of at most [`SIDE`] pixels a side: means of square blocks.
fn small(width: u32, height: u32, pixels: &[[f32; 3]]) -> Result<Vec<u8>, String> {
    let block = width.max(height).div_ceil(SIDE).max(1);
    let (w, h) = (width.div_ceil(block), height.div_ceil(block));
    let mut out = Vec::with_capacity(w as usize * h as usize);
    for (y, x) in (0..h).flat_map(|y| (0..w).map(move |x| (y, x))) {
        let (mut sum, mut n) = ([0.0; 3], 0.0);
        for py in y * block..((y + 1) * block).min(height) {
            for px in x * block..((x + 1) * block).min(width) {
                let Some(p) = pixels.get(py as usize * width as usize + px as usize) else { continue };
                (0..3).for_each(|c| sum[c] += p[c]);
                n += 1.0;
            }
        }
        out.push(sum.map(|s: f32| s / n));
    }
    png::encode_pixels(w, h, &out, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn previews_are_small() {
        let pixels = vec![[0.5; 3]; 1500 * 10];
        let png = small(1500, 10, &pixels).unwrap();
        // Width and height of the PNG's header.
        let side = |at: usize| u32::from_be_bytes(png[at..at + 4].try_into().unwrap());
        assert_eq!((side(16), side(20)), (500, 4));
    }
}
