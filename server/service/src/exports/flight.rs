//! The way of a camera through saved views.
//!
//! What is interpolated is what a person sees change: the point looked at, the logarithm of the
//! distance to it, the rotation, and the logarithm of the picture's size (`tan(fov / 2)`, or the
//! orthographic height). Each is a cubic in Hermite form between two views, so the way goes through
//! every view and its velocity is continuous. At a view between others the velocity is that of the
//! parabola through it and its neighbours, no longer than three times the slower of the two sides:
//! then a number that only grows never overshoots (Fritsch and Carlson 1980), and two equal views
//! hold the camera still. Where the way turns back, and at both ends, the camera rests.
//!
//! Rotations follow the cubic in the form of Kim, Kim and Shin 1995, a product of three rotations
//! about fixed axes, and take the shorter way from view to view.

use std::ops::{Add, Mul, Sub};

use glam::{DMat3, DQuat, DVec3};
use proto::rest::CameraKey;
use proto::scene_file::Camera;

/// Longest velocity at a view, in those of the slower side: the largest that keeps a cubic monotone.
const MAX_OVER_SLOWER_SIDE: f64 = 3.0;

/// A view in what is interpolated.
#[derive(Debug, Clone, Copy)]
struct Pose {
    target: DVec3,
    /// Logarithm of the distance from the target to the eye, and of the picture's size.
    logs: DVec3,
    /// View axes (right, up, back) to world.
    world_from_view: DQuat,
}

/// How fast a pose changes, per second.
#[derive(Debug, Clone, Copy, Default)]
struct Velocity {
    target: DVec3,
    logs: DVec3,
    /// About axes of the view, radians.
    rotation: DVec3,
}

impl Pose {
    fn of(camera: &Camera) -> Self {
        let target = DVec3::from_array(camera.target);
        let arm = DVec3::from_array(camera.position) - target;
        let back = arm.normalize_or(DVec3::Z);
        let right = DVec3::from_array(camera.up).cross(back).normalize_or(back.any_orthonormal_vector());
        let size = match (camera.orthographic_height, camera.fov_y_degrees) {
            (Some(height), _) => height,
            (None, fov) => (fov.unwrap_or_default().to_radians() / 2.0).tan(),
        };
        Self {
            target,
            logs: DVec3::new(arm.length().ln(), size.ln(), 0.0),
            world_from_view: DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back)),
        }
    }

    /// The camera of the pose, with the projection of another one.
    fn camera(&self, like: &Camera) -> Camera {
        let (distance, size) = (self.logs.x.exp(), self.logs.y.exp());
        let position = self.target + self.world_from_view * DVec3::Z * distance;
        Camera {
            position: position.to_array(),
            target: self.target.to_array(),
            up: (self.world_from_view * DVec3::Y).to_array(),
            fov_y_degrees: like.fov_y_degrees.map(|_| 2.0 * size.atan().to_degrees()),
            orthographic_height: like.orthographic_height.map(|_| size),
        }
    }
}

/// Rotation vector of the shorter of the two ways that a quaternion stands for.
fn shortest(rotation: DQuat) -> DVec3 {
    if rotation.w < 0.0 { -rotation } else { rotation }.to_scaled_axis()
}

/// Mean velocity from one pose to the next.
fn between(from: &Pose, to: &Pose, seconds: f64) -> Velocity {
    Velocity {
        target: (to.target - from.target) / seconds,
        logs: (to.logs - from.logs) / seconds,
        rotation: shortest(from.world_from_view.conjugate() * to.world_from_view) / seconds,
    }
}

/// Velocity at a view, from the mean ones of both sides and their lengths in seconds.
fn through<T>(before: T, after: T, seconds: [f64; 2], dot: impl Fn(T, T) -> f64) -> T
where
    T: Copy + Default + Add<Output = T> + Mul<f64, Output = T>,
{
    if dot(before, after) <= 0.0 {
        return T::default();
    }
    let parabola = (before * seconds[1] + after * seconds[0]) * (1.0 / (seconds[0] + seconds[1]));
    let slower = dot(before, before).min(dot(after, after)).sqrt();
    let length = dot(parabola, parabola).sqrt();
    parabola * (MAX_OVER_SLOWER_SIDE * slower / length).min(1.0)
}

/// Shares of a cubic's three parts, at a share of its time: what it leaves with, the middle, what it
/// arrives with.
fn shares(t: f64) -> [f64; 3] {
    let rest = 1.0 - t;
    [1.0 - rest * rest * rest, t * t * (3.0 - 2.0 * t), t * t * t]
}

/// The cubic from one value to another, leaving and arriving with thirds of the velocities times the
/// time between.
fn cubic<T>(from: T, to: T, leaving: T, arriving: T, t: f64) -> T
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>,
{
    let [first, middle, last] = shares(t);
    from + leaving * first + (to - from - leaving - arriving) * middle + arriving * last
}

/// A way through views.
pub struct Flight {
    keys: Vec<CameraKey>,
    poses: Vec<Pose>,
    velocities: Vec<Velocity>,
}

impl Flight {
    /// The way through these views: at least two, their times ascending, of one projection.
    pub fn new(keys: &[CameraKey]) -> Self {
        let poses: Vec<Pose> = keys.iter().map(|key| Pose::of(&key.camera)).collect();
        let seconds: Vec<f64> = keys.windows(2).map(|pair| pair[1].seconds - pair[0].seconds).collect();
        let means: Vec<Velocity> =
            poses.windows(2).zip(&seconds).map(|(pair, &long)| between(&pair[0], &pair[1], long)).collect();
        let mut velocities = vec![Velocity::default(); keys.len()];
        for (index, sides) in means.windows(2).enumerate() {
            let long = [seconds[index], seconds[index + 1]];
            let number = |x: f64, y: f64| through(x, y, long, |a, b| a * b);
            let vector = |x: DVec3, y: DVec3| through(x, y, long, DVec3::dot);
            let (before, after) = (&sides[0], &sides[1]);
            velocities[index + 1] = Velocity {
                target: vector(before.target, after.target),
                logs: DVec3::new(
                    number(before.logs.x, after.logs.x),
                    number(before.logs.y, after.logs.y),
                    0.0,
                ),
                rotation: vector(before.rotation, after.rotation),
            };
        }
        Self { keys: keys.to_vec(), poses, velocities }
    }

    /// The camera at a time, seconds; the first or last view before and after.
    pub fn at(&self, seconds: f64) -> Camera {
        // The view that comes next; a view itself is told as it was given, bit by bit.
        let next = self.keys.partition_point(|key| key.seconds <= seconds);
        if next == 0 {
            return self.keys[0].camera.clone();
        }
        let (last, key) = (next - 1, &self.keys[next - 1]);
        if next == self.keys.len() || key.seconds == seconds {
            return key.camera.clone();
        }
        let long = self.keys[next].seconds - key.seconds;
        let t = (seconds - key.seconds) / long;
        let (from, to) = (&self.poses[last], &self.poses[next]);
        let third = long / 3.0;
        let (leaving, arriving) = (&self.velocities[last], &self.velocities[next]);
        let [first, middle, end] = shares(t);
        let (leave, arrive) = (leaving.rotation * third, arriving.rotation * third);
        let rotation = |vector: DVec3| DQuat::from_scaled_axis(vector);
        let whole = from.world_from_view.conjugate() * to.world_from_view;
        let rest = shortest(rotation(-leave) * whole * rotation(-arrive));
        let turned = rotation(leave * first) * rotation(rest * middle) * rotation(arrive * end);
        let pose = Pose {
            target: cubic(from.target, to.target, leaving.target * third, arriving.target * third, t),
            logs: cubic(from.logs, to.logs, leaving.logs * third, arriving.logs * third, t),
            world_from_view: (from.world_from_view * turned).normalize(),
        };
        pose.camera(&key.camera)
    }

    /// Cameras of so many pictures, at least two: the first and the last view, and evenly in time
    /// between.
    pub fn way(self, frames: u32) -> impl Iterator<Item = Camera> {
        let first = self.keys.first().map_or(0.0, |key| key.seconds);
        let last = self.keys.last().map_or(0.0, |key| key.seconds);
        (0..frames).map(move |frame| {
            // Whole shares first, so that the last picture is at the last view exactly.
            let share = f64::from(frame) / f64::from(frames - 1);
            self.at(first * (1.0 - share) + last * share)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(seconds: f64, position: [f64; 3], target: [f64; 3], fov: f64) -> CameraKey {
        let up = [0.0, 0.0, 1.0];
        let camera = Camera { position, target, up, fov_y_degrees: Some(fov), orthographic_height: None };
        CameraKey { seconds, camera }
    }

    /// Around, nearer, aside, wider: at uneven times.
    fn keys() -> Vec<CameraKey> {
        vec![
            key(1.0, [3.0, 0.0, 0.0], [0.0; 3], 40.0),
            key(2.0, [0.0, 2.0, 0.5], [0.0; 3], 40.0),
            key(5.0, [-1.0, 0.3, 1.0], [0.1, 0.2, 0.0], 30.0),
            key(5.5, [-1.0, -0.7, 1.2], [0.2, 0.3, 0.1], 20.0),
        ]
    }

    /// Where the eye is, what it looks at, where up is, what angle it sees, in one row of numbers.
    fn row(camera: &Camera) -> [f64; 10] {
        let mut row = [0.0; 10];
        row[..3].copy_from_slice(&camera.position);
        row[3..6].copy_from_slice(&camera.target);
        row[6..9].copy_from_slice(&camera.up);
        row[9] = camera.fov_y_degrees.unwrap() / 40.0;
        row
    }

    fn apart(a: [f64; 10], b: [f64; 10]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    fn velocity(flight: &Flight, from: f64, to: f64) -> [f64; 10] {
        let (a, b) = (row(&flight.at(from)), row(&flight.at(to)));
        std::array::from_fn(|i| (b[i] - a[i]) / (to - from))
    }

    #[test]
    fn the_way_goes_through_every_view() {
        let keys = keys();
        let flight = Flight::new(&keys);
        for key in &keys {
            assert_eq!(flight.at(key.seconds), key.camera);
            for aside in [-1e-7, 1e-7] {
                let mut near = flight.at(key.seconds + aside);
                // Up is told at right angles to the view between the given ones.
                near.up = key.camera.up;
                assert!(apart(row(&near), row(&key.camera)) < 1e-5, "{near:?} is not {:?}", key.camera);
            }
        }
        let seen: Vec<Camera> = flight.way(46).collect();
        assert_eq!(seen.len(), 46);
        assert_eq!((&seen[0], &seen[10], &seen[45]), (&keys[0].camera, &keys[1].camera, &keys[3].camera));
    }

    #[test]
    fn its_velocity_is_continuous_and_nothing_at_the_ends() {
        let keys = keys();
        let flight = Flight::new(&keys);
        let step = 1e-6;
        for key in &keys[1..3] {
            let before = velocity(&flight, key.seconds - 2.0 * step, key.seconds - step);
            let after = velocity(&flight, key.seconds + step, key.seconds + 2.0 * step);
            assert!(apart(before, after) < 1e-3, "{before:?} and {after:?} at {} s", key.seconds);
            assert!(apart(before, [0.0; 10]) > 0.1, "the camera does not halt on its way");
        }
        for (from, to) in [(1.0 + step, 1.0 + 2.0 * step), (5.5 - 2.0 * step, 5.5 - step)] {
            assert!(apart(velocity(&flight, from, to), [0.0; 10]) < 1e-3);
        }
        // What would be noticed: straight lines from view to view.
        let corners = [velocity(&flight, 1.0, 2.0), velocity(&flight, 2.0, 5.0)];
        assert!(apart(corners[0], corners[1]) > 1.0);
    }

    #[test]
    fn rotations_take_the_shorter_way_at_their_distance() {
        let around = |degrees: f64| {
            let (y, x) = degrees.to_radians().sin_cos();
            [2.0 * x, 2.0 * y, 0.0]
        };
        let flight =
            Flight::new(&[key(0.0, around(170.0), [0.0; 3], 40.0), key(1.0, around(-170.0), [0.0; 3], 40.0)]);
        let middle = flight.at(0.5);
        assert!(apart(row(&middle), row(&key(0.0, around(180.0), [0.0; 3], 40.0).camera)) < 1e-12);
        for step in 0..=20 {
            let camera = flight.at(f64::from(step) / 20.0);
            assert!((DVec3::from_array(camera.position).length() - 2.0).abs() < 1e-12);
            assert!(DVec3::from_array(camera.up).distance(DVec3::Z) < 1e-12, "the horizon stays level");
            assert!(camera.position[0] < -1.9, "by way of the far side: {camera:?}");
        }
    }

    #[test]
    fn equal_views_hold_the_camera_and_nothing_overshoots() {
        let near = [1.0, 0.0, 0.0];
        let flight = Flight::new(&[
            key(0.0, [4.0, 0.0, 0.0], [0.0; 3], 60.0),
            key(1.0, near, [0.0; 3], 30.0),
            key(4.0, near, [0.0; 3], 30.0),
            key(4.2, [0.0, 2.0, 0.0], [0.0; 3], 30.0),
        ]);
        let mut last = f64::INFINITY;
        for step in 0..=400 {
            let seconds = f64::from(step) / 100.0;
            let camera = flight.at(seconds);
            let distance = DVec3::from_array(camera.position).length();
            assert!(distance <= last + 1e-12 && distance >= 1.0 - 1e-12, "{distance} at {seconds} s");
            assert!(camera.fov_y_degrees.unwrap() >= 30.0 - 1e-9);
            assert!(seconds < 1.0 || DVec3::from_array(camera.position).distance(near.into()) < 1e-12);
            last = distance;
        }
    }

    #[test]
    fn heights_without_perspective_are_interpolated_too() {
        let flat = |seconds, height| {
            let mut key = key(seconds, [2.0, 0.0, 0.0], [0.0; 3], 40.0);
            (key.camera.fov_y_degrees, key.camera.orthographic_height) = (None, Some(height));
            key
        };
        let middle = Flight::new(&[flat(0.0, 1.0), flat(2.0, 4.0)]).at(1.0);
        assert!(middle.fov_y_degrees.is_none());
        assert!((middle.orthographic_height.unwrap() - 2.0).abs() < 1e-12, "half-way by the eye");
    }
}
