//! The way of a turntable's camera.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use proto::scene_file::Camera;

/// The camera turned about its target, around its own upright axis, by a share of a turn; positive
/// turns are right-handed about that axis.
pub fn turned(camera: &Camera, turns: f64) -> Camera {
    let up = DVec3::from_array(camera.up).normalize_or(DVec3::Y);
    let target = DVec3::from_array(camera.target);
    let rotation = DQuat::from_axis_angle(up, TAU * turns);
    let position = target + rotation * (DVec3::from_array(camera.position) - target);
    Camera { position: position.to_array(), ..camera.clone() }
}

/// Cameras of so many pictures of a way of so many turns. The last one is a step before the end, so
/// that whole turns go on without a halt when they are played again.
pub fn way(camera: &Camera, frames: u32, turns: f64) -> impl Iterator<Item = Camera> + use<> {
    let camera = camera.clone();
    (0..frames).map(move |frame| turned(&camera, turns * f64::from(frame) / f64::from(frames)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera {
            position: [3.0, 1.0, 0.5],
            target: [0.0, 1.0, 0.5],
            up: [0.0, 0.0, 2.0],
            fov_y_degrees: Some(40.0),
            orthographic_height: None,
        }
    }

    #[test]
    fn a_turn_goes_around_and_comes_back() {
        let seen: Vec<Camera> = way(&camera(), 4, 1.0).collect();
        let expected = [[3.0, 1.0, 0.5], [0.0, 4.0, 0.5], [-3.0, 1.0, 0.5], [0.0, -2.0, 0.5]];
        assert_eq!(seen.len(), 4);
        for (camera, expected) in seen.iter().zip(expected) {
            let apart = DVec3::from_array(camera.position).distance(DVec3::from_array(expected));
            assert!(apart < 1e-12, "{camera:?}");
            assert_eq!((camera.target, camera.up), ([0.0, 1.0, 0.5], [0.0, 0.0, 2.0]));
        }
        let back = turned(&camera(), 1.0);
        assert!(DVec3::from_array(back.position).distance(DVec3::new(3.0, 1.0, 0.5)) < 1e-12);
    }

    #[test]
    fn negative_turns_go_the_other_way() {
        let there = turned(&camera(), 0.125).position;
        let other = turned(&camera(), -0.125).position;
        assert!((there[1] - 1.0 + (other[1] - 1.0)).abs() < 1e-12 && there[1] > 1.0);
    }
}
