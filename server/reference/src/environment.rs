//! Environment images: radiance from a direction, and directions in proportion to radiance.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use scene::EnvironmentImage;

/// An image with what is needed to sample it.
///
/// Directions are drawn texel by texel, in proportion to the mean of the bilinear radiance over a
/// texel times its solid angle, and uniformly over the solid angle within. The density is above 0
/// wherever there is radiance.
pub struct Environment {
    image: Arc<EnvironmentImage>,
    world_from_map: DMat3,
    scale: DVec3,
    /// Cumulative share of the rows, starting at 0.
    rows: Vec<f64>,
    /// Cumulative share of the columns within each row, starting at 0.
    columns: Vec<f64>,
}

impl Environment {
    /// Prepares an image; `scale` multiplies its texels.
    pub fn new(image: &Arc<EnvironmentImage>, world_from_map: DMat3, scale: DVec3) -> Self {
        let (width, height) = (image.width(), image.height());
        let brightness = |x: usize, y: usize| -> f64 {
            let [r, g, b] = image.texels()[y * width + x].map(f64::from);
            r * scale.x + g * scale.y + b * scale.z
        };
        // The mean over a texel of what is linear between centres: 1/8, 6/8, 1/8.
        let smoothed = |before: f64, here: f64, after: f64| 0.125 * before + 0.75 * here + 0.125 * after;
        let row_mean = |x: usize, y: usize| {
            smoothed(brightness((x + width - 1) % width, y), brightness(x, y), brightness((x + 1) % width, y))
        };
        let mut columns = Vec::with_capacity((width + 1) * height);
        let mut row_weights = Vec::with_capacity(height);
        for y in 0..height {
            let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
            let mean = |x: usize| smoothed(row_mean(x, above), row_mean(x, y), row_mean(x, below));
            let (cumulative, total) = cumulate((0..width).map(mean));
            columns.extend(cumulative);
            row_weights.push(total * row_solid_angle(y, height));
        }
        let (rows, _) = cumulate(row_weights.into_iter());
        Self { image: image.clone(), world_from_map, scale, rows, columns }
    }

    /// Radiance that arrives from a unit direction, linear RGB.
    pub fn radiance(&self, towards: DVec3) -> DVec3 {
        let (width, height) = (self.image.width(), self.image.height());
        let [u, v] = self.uv(towards);
        let (x, y) = (u * width as f64 - 0.5, v * height as f64 - 0.5);
        let (x_low, y_low) = (x.floor(), y.floor());
        let (fx, fy) = (x - x_low, y - y_low);
        let texel = |x: f64, y: f64| {
            let x = (x as i64).rem_euclid(width as i64) as usize;
            let y = (y as i64).clamp(0, height as i64 - 1) as usize;
            DVec3::from_array(self.image.texels()[y * width + x].map(f64::from))
        };
        let row = |y: f64| texel(x_low, y) * (1.0 - fx) + texel(x_low + 1.0, y) * fx;
        self.scale * (row(y_low) * (1.0 - fy) + row(y_low + 1.0) * fy)
    }

    /// A direction towards light and its density per steradian; `None` from a black image.
    pub fn sample(&self, [a, b]: [f64; 2]) -> Option<(DVec3, f64)> {
        let (width, height) = (self.image.width(), self.image.height());
        let (y, within_y) = invert(&self.rows, b)?;
        let (x, within_x) = invert(self.row(y), a)?;
        let u = (x as f64 + within_x) / width as f64;
        // Uniform over the solid angle: in the cosine of the polar angle.
        let [top, bottom] = row_cosines(y, height);
        let cosine = top + within_y * (bottom - top);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let azimuth = 2.0 * PI * u;
        let towards = DVec3::new(sine * azimuth.sin(), cosine, -sine * azimuth.cos());
        Some(((self.world_from_map * towards).normalize(), self.texel_density(x, y)))
    }

    /// Density per steradian with which [`Environment::sample`] chooses a direction.
    pub fn pdf(&self, towards: DVec3) -> f64 {
        let (width, height) = (self.image.width(), self.image.height());
        let [u, v] = self.uv(towards);
        let x = ((u * width as f64) as usize).min(width - 1);
        let y = ((v * height as f64) as usize).min(height - 1);
        self.texel_density(x, y)
    }

    fn texel_density(&self, x: usize, y: usize) -> f64 {
        let row = self.row(y);
        let share = (self.rows[y + 1] - self.rows[y]) * (row[x + 1] - row[x]);
        share * self.image.width() as f64 / row_solid_angle(y, self.image.height())
    }

    fn row(&self, y: usize) -> &[f64] {
        let stride = self.image.width() + 1;
        &self.columns[y * stride..(y + 1) * stride]
    }

    /// Place of a direction in the image, each 0..1.
    fn uv(&self, towards: DVec3) -> [f64; 2] {
        let map = self.world_from_map.transpose() * towards;
        let turns = map.x.atan2(-map.z) / (2.0 * PI);
        [turns.rem_euclid(1.0), map.y.clamp(-1.0, 1.0).acos() / PI]
    }
}

/// Cosines of the polar angle at the upper and lower edge of a row.
fn row_cosines(y: usize, height: usize) -> [f64; 2] {
    [y, y + 1].map(|edge| (PI * edge as f64 / height as f64).cos())
}

/// Solid angle of a whole row of texels.
fn row_solid_angle(y: usize, height: usize) -> f64 {
    let [top, bottom] = row_cosines(y, height);
    2.0 * PI * (top - bottom)
}

/// Running sums from 0 to 1 (to 0 if all weights are 0), and the sum of the weights.
fn cumulate(weights: impl Iterator<Item = f64>) -> (Vec<f64>, f64) {
    let mut sums = vec![0.0];
    let mut total = 0.0;
    for weight in weights {
        total += weight;
        sums.push(total);
    }
    if total > 0.0 {
        sums.iter_mut().for_each(|sum| *sum /= total);
    }
    (sums, total)
}

/// The step of a cumulative distribution that holds `u`, and where within it `u` lies.
fn invert(cumulative: &[f64], u: f64) -> Option<(usize, f64)> {
    let after = cumulative.partition_point(|&sum| sum <= u);
    let (low, high) = (*cumulative.get(after.checked_sub(1)?)?, *cumulative.get(after)?);
    Some((after - 1, (u - low) / (high - low)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 4 x 2 texels, each with a radiance of its own in red.
    fn image() -> Arc<EnvironmentImage> {
        let rgb: Vec<f32> = (0..8).flat_map(|i| [i as f32, 1.0, 0.0]).collect();
        Arc::new(EnvironmentImage::new(4, 2, &rgb).unwrap())
    }

    #[test]
    fn texel_centres_lie_where_the_format_says() {
        let environment = Environment::new(&image(), DMat3::IDENTITY, DVec3::splat(2.0));
        for (x, y) in (0..4).flat_map(|x| (0..2).map(move |y| (x, y))) {
            let (u, v) = ((f64::from(x) + 0.5) / 4.0, (f64::from(y) + 0.5) / 2.0);
            let (u, v) = (2.0 * PI * u, PI * v);
            let towards = DVec3::new(v.sin() * u.sin(), v.cos(), -v.sin() * u.cos());
            let radiance = environment.radiance(towards);
            assert!(
                (radiance - DVec3::new(2.0 * f64::from(4 * y + x), 2.0, 0.0)).length() < 1e-9,
                "{radiance}"
            );
        }
        // At u = 0 between the last column and the first; above the top row its own values.
        let seam = environment.radiance(DVec3::new(0.0, 1.0, -1.0).normalize());
        assert!((seam.x - 2.0 * 1.5).abs() < 1e-9, "{seam}");
        let pole = environment.radiance(DVec3::new(1e-9, 1.0, -1e-9).normalize());
        assert!(pole.x <= 2.0 * 3.0 + 1e-9 && pole.x >= 0.0, "{pole}");
    }

    #[test]
    fn rotation_turns_the_map_into_the_world() {
        let quarter = DMat3::from_rotation_y(0.5 * PI);
        let (still, turned) = (
            Environment::new(&image(), DMat3::IDENTITY, DVec3::ONE),
            Environment::new(&image(), quarter, DVec3::ONE),
        );
        let towards = DVec3::new(0.3, 0.5, -0.8).normalize();
        assert!((still.radiance(towards) - turned.radiance(quarter * towards)).length() < 1e-9);
        assert!((still.pdf(towards) - turned.pdf(quarter * towards)).abs() < 1e-9);
    }

    #[test]
    fn a_black_image_is_not_sampled() {
        let black = Arc::new(EnvironmentImage::new(2, 2, &[0.0; 12]).unwrap());
        assert!(Environment::new(&black, DMat3::IDENTITY, DVec3::ONE).sample([0.3, 0.4]).is_none());
    }
}
