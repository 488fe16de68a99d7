//! Linear Rec.709 colour.

mod rgb;

pub use rgb::Rgb;
