//! When a viewer needs what, by a clock of the test's own.

use proto::SceneFile;
use scene::{PreparedVolume, Scene, Volume, Voxels};
use serde_json::json;
use tokio::sync::mpsc;

use super::*;
use crate::render_thread::Link;

/// The exact picture is to be begun so long after the last input, where nobody else is served.
const PROMISED: Duration = Duration::from_millis(250);
const VIEWPORT: (u32, u32) = (64, 48);

/// A viewer whose newest input is shown as a moving picture.
fn moved() -> Watched {
    let file = json!({"version": 1, "volume": {"builtin": "homogeneous"},
        "transfer_function": {"points": [{"s": 0, "extinction": 0}, {"s": 1, "extinction": 4}]}});
    let volume = Arc::new(PreparedVolume::new(Volume::new([2; 3], Voxels::U8(vec![1; 8])), &|_| {}));
    let scene = Scene::new(&SceneFile::from_value(file).unwrap(), volume).unwrap();
    let snapshot = Arc::new(Snapshot { epoch: 1, scene });
    let input = ViewerInput {
        snapshot: snapshot.clone(),
        light: Light::default(),
        viewport: Some(VIEWPORT),
        visible: true,
        seq: 1,
        arrived: Instant::now(),
        acknowledged: 0,
        link: Link::default(),
        resumed: 0,
        outputs: mpsc::channel(1).0,
    };
    let mut watched = Watched::new(input, true, Account::default());
    watched.shown = Some(Shown {
        snapshot,
        viewport: VIEWPORT,
        pixels: 100,
        samples_at_full_size: 0,
        illumination: 1.0,
        is_final: false,
        sent: watched.changed,
    });
    watched
}

#[test]
fn at_rest_the_exact_picture_is_begun_in_time() {
    let watched = moved();
    let last_input = watched.changed;
    assert_eq!(watched.need(last_input), Need::Until(last_input + REST_DELAY));
    assert_eq!(watched.need(last_input + REST_DELAY / 2), Need::Until(last_input + REST_DELAY));
    assert_eq!(watched.need(last_input + REST_DELAY), Need::Still);
    // Before it there may be the moving picture of the last input, in its time on a slow device.
    assert!(FRAME_INTERVAL + MOVING_TIME_SOFTWARE.max(REST_DELAY) <= PROMISED);
}

#[test]
fn another_input_puts_it_off_and_shows_at_once() {
    let mut watched = moved();
    let mut input = watched.input.clone();
    input.viewport = Some((80, 60));
    watched.take(&input);
    assert_eq!(watched.need(watched.changed), Need::Moving);
}

#[test]
fn frames_that_nobody_acknowledged_hold_it_back() {
    let mut watched = moved();
    let at_rest = watched.changed + REST_DELAY;
    watched.frame = MAX_FRAMES_IN_FLIGHT;
    assert_eq!(watched.need(at_rest), Need::Nothing);
    watched.input.acknowledged = 1;
    assert_eq!(watched.need(at_rest), Need::Still);
    watched.input.visible = false;
    assert_eq!(watched.need(at_rest), Need::Nothing);
}
