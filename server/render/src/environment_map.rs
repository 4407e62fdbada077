//! Environment images as the path tracer reads them: texels, and how directions are drawn.

use std::f64::consts::PI;

use scene::EnvironmentImage;

/// Texels of the radiance texture, rows from the top; with each the share of draws in its row and those above.
pub(crate) fn radiance(image: &EnvironmentImage) -> Vec<[f32; 4]> {
    let width = image.width();
    let shares = shares(image).unwrap_or_default();
    let of_rows: Vec<f64> = shares.chunks(width).map(|row| row.iter().sum()).collect();
    let up_to_rows = running_sums(&of_rows);
    let texel = |(index, &[r, g, b]): (usize, &[f32; 3])| {
        [r, g, b, up_to_rows.get(index / width).copied().unwrap_or(0.0)]
    };
    image.texels().iter().enumerate().map(texel).collect()
}

/// Sums up to each, as shares of the last, which is 1.
fn running_sums(shares: &[f64]) -> Vec<f32> {
    let total: f64 = shares.iter().sum();
    let mut sum = 0.0;
    let mut up_to = |share: &f64| {
        sum += share;
        if total > 0.0 { (sum / total) as f32 } else { 1.0 }
    };
    shares.iter().map(&mut up_to).collect()
}

/// Integral over the sphere of the mean of red, green and blue, as `draws` weights directions.
pub(crate) fn mean_total(image: &EnvironmentImage) -> f64 {
    let (width, height) = (image.width(), image.height());
    let row = |y: usize| {
        let [top, bottom] = [y, y + 1].map(|edge| (PI * edge as f64 / height as f64).cos());
        let texels = &image.texels()[y * width..(y + 1) * width];
        let sum: f64 = texels.iter().flatten().map(|&value| f64::from(value)).sum();
        sum / 3.0 * 2.0 * PI * (top - bottom) / width as f64
    };
    (0..height).map(row).sum()
}

/// Texels of the table of draws: the share of draws that stay with a texel, the texel that takes
/// the others, the density per steradian of the texel's directions, and the share of its row's draws in it and
/// those before it. Texels are drawn in
/// proportion to the mean of the bilinear radiance over them (sum of its channels) times their solid
/// angle, and directions uniformly within, so that the density is above 0 wherever there is light.
pub(crate) fn draws(image: &EnvironmentImage) -> Vec<[f32; 4]> {
    let width = image.width();
    let Some(shares) = shares(image) else {
        return vec![[1.0, 0.0, 0.0, 0.0]; image.texels().len()];
    };
    let in_rows: Vec<f32> = shares.chunks(width).flat_map(running_sums).collect();
    let texel = |(index, (stay, other)): (usize, (f64, usize))| {
        let density = shares[index] / solid_angle(image, index / width);
        [stay as f32, other as f32, density as f32, in_rows[index]]
    };
    alias_table(&shares).into_iter().enumerate().map(texel).collect()
}

/// Of a texel in this row, steradians.
fn solid_angle(image: &EnvironmentImage, y: usize) -> f64 {
    let [top, bottom] = [y, y + 1].map(|edge| (PI * edge as f64 / image.height() as f64).cos());
    2.0 * PI * (top - bottom) / image.width() as f64
}

/// Shares of draws; `None`: the image is black.
fn shares(image: &EnvironmentImage) -> Option<Vec<f64>> {
    let (width, height) = (image.width(), image.height());
    let brightness = |x: usize, y: usize| image.texels()[y * width + x].map(f64::from).iter().sum::<f64>();
    // The mean over a texel of what is linear between centres: 1/8, 6/8, 1/8.
    let smoothed = |before: f64, here: f64, after: f64| 0.125 * before + 0.75 * here + 0.125 * after;
    let along_row = |x: usize, y: usize| {
        smoothed(brightness((x + width - 1) % width, y), brightness(x, y), brightness((x + 1) % width, y))
    };
    let mean = |x: usize, y: usize| {
        let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
        smoothed(along_row(x, above), along_row(x, y), along_row(x, below))
    };
    let weights: Vec<f64> =
        (0..width * height).map(|i| mean(i % width, i / width) * solid_angle(image, i / width)).collect();
    let total: f64 = weights.iter().sum();
    (total > 0.0).then(|| weights.iter().map(|weight| weight / total).collect())
}

/// For each of n outcomes with these shares (their sum is 1): the share of draws of 1 / n that stay
/// with it, and the outcome that takes the others (Vose 1991).
fn alias_table(shares: &[f64]) -> Vec<(f64, usize)> {
    let count = shares.len() as f64;
    let mut left: Vec<f64> = shares.iter().map(|share| share * count).collect();
    let mut table: Vec<(f64, usize)> = (0..shares.len()).map(|index| (1.0, index)).collect();
    let (mut poor, mut rich): (Vec<usize>, Vec<usize>) =
        (0..shares.len()).partition(|&index| left[index] < 1.0);
    while let (Some(&from), Some(to)) = (rich.last(), poor.pop()) {
        table[to] = (left[to], from);
        left[from] -= 1.0 - left[to];
        if left[from] < 1.0 {
            rich.pop();
            poor.push(from);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_have_their_shares() {
        let shares = [0.5, 0.0, 0.125, 0.3, 0.075];
        let mut drawn = [0.0; 5];
        for (index, (stay, other)) in alias_table(&shares).into_iter().enumerate() {
            drawn[index] += stay / 5.0;
            drawn[other] += (1.0 - stay) / 5.0;
        }
        assert!(drawn.iter().zip(shares).all(|(a, b)| (a - b).abs() < 1e-12), "{drawn:?}");
    }

    #[test]
    fn densities_integrate_to_one_and_follow_the_light() {
        let rgb: Vec<f32> = (0..8 * 4).flat_map(|i| [(i * i % 7) as f32, 0.5, 0.0]).collect();
        let image = EnvironmentImage::new(8, 4, &rgb).unwrap();
        let draws = draws(&image);
        let area = |y: usize| {
            let [top, bottom] = [y, y + 1].map(|edge| (PI * edge as f64 / 4.0).cos());
            2.0 * PI * (top - bottom) / 8.0
        };
        let sum: f64 = draws.iter().enumerate().map(|(i, draw)| f64::from(draw[2]) * area(i / 8)).sum();
        assert!((sum - 1.0).abs() < 1e-6, "{sum}");
        let black = EnvironmentImage::new(1, 2, &[0.0; 6]).unwrap();
        assert_eq!(super::draws(&black), [[1.0, 0.0, 0.0, 0.0]; 2]);
    }
}
