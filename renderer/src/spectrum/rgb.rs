use serde::{Deserialize, Serialize};
use std::ops::{Add, AddAssign, Div, DivAssign, Index, Mul, MulAssign, Neg, Sub};

/// Linear Rec.709 triple: radiance, reflectance, or whatever the context says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
#[serde(from = "[f32; 3]", into = "[f32; 3]")]
pub struct Rgb {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
}

impl Rgb {
    /// Black.
    pub const ZERO: Self = Self::splat(0.0);
    /// White.
    pub const ONE: Self = Self::splat(1.0);

    /// From its components.
    #[inline]
    pub const fn new(r: f32, g: f32, b: f32) -> Self {
        Self { r, g, b }
    }

    /// A grey.
    #[inline]
    pub const fn splat(v: f32) -> Self {
        Self { r: v, g: v, b: v }
    }

    /// Rec.709 luminance.
    #[inline]
    pub fn luminance(self) -> f32 {
        0.212_671 * self.r + 0.715_160 * self.g + 0.072_169 * self.b
    }

    /// The largest component.
    #[inline]
    pub fn max_component(self) -> f32 {
        self.r.max(self.g).max(self.b)
    }

    /// The smallest component.
    #[inline]
    pub fn min_component(self) -> f32 {
        self.r.min(self.g).min(self.b)
    }

    /// Whether every component is exactly zero.
    #[inline]
    pub fn is_black(self) -> bool {
        self.r == 0.0 && self.g == 0.0 && self.b == 0.0
    }

    /// Whether every component is finite and not negative.
    #[inline]
    pub fn is_valid(self) -> bool {
        self.r.is_finite() && self.g.is_finite() && self.b.is_finite() && self.min_component() >= 0.0
    }

    /// Applies `f` to each component.
    #[inline]
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        Self::new(f(self.r), f(self.g), f(self.b))
    }

    /// As an array.
    #[inline]
    pub const fn to_array(self) -> [f32; 3] {
        [self.r, self.g, self.b]
    }
}

impl From<[f32; 3]> for Rgb {
    fn from(v: [f32; 3]) -> Self {
        Self::new(v[0], v[1], v[2])
    }
}

impl From<Rgb> for [f32; 3] {
    fn from(v: Rgb) -> Self {
        v.to_array()
    }
}

impl Index<usize> for Rgb {
    type Output = f32;
    #[inline]
    fn index(&self, i: usize) -> &f32 {
        match i {
            0 => &self.r,
            1 => &self.g,
            _ => &self.b,
        }
    }
}

macro_rules! componentwise {
    ($($trait:ident $f:ident $op:tt, $assign:ident $fa:ident;)*) => {$(
        impl $trait for Rgb {
            type Output = Self;
            #[inline]
            fn $f(self, o: Self) -> Self { Self::new(self.r $op o.r, self.g $op o.g, self.b $op o.b) }
        }
        impl $assign for Rgb {
            #[inline]
            fn $fa(&mut self, o: Self) { *self = *self $op o; }
        }
    )*};
}
componentwise! { Add add +, AddAssign add_assign; Mul mul *, MulAssign mul_assign; }

impl Sub for Rgb {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self::new(self.r - o.r, self.g - o.g, self.b - o.b)
    }
}

impl Div for Rgb {
    type Output = Self;
    #[inline]
    fn div(self, o: Self) -> Self {
        Self::new(self.r / o.r, self.g / o.g, self.b / o.b)
    }
}

impl Mul<f32> for Rgb {
    type Output = Self;
    #[inline]
    fn mul(self, s: f32) -> Self {
        self.map(|v| v * s)
    }
}

impl MulAssign<f32> for Rgb {
    #[inline]
    fn mul_assign(&mut self, s: f32) {
        *self = *self * s;
    }
}

impl Div<f32> for Rgb {
    type Output = Self;
    #[inline]
    fn div(self, s: f32) -> Self {
        self.map(|v| v / s)
    }
}

impl DivAssign<f32> for Rgb {
    #[inline]
    fn div_assign(&mut self, s: f32) {
        *self = *self / s;
    }
}

impl Neg for Rgb {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.map(|v| -v)
    }
}
