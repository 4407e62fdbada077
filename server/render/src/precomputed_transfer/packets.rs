//! Whose the photons of a bake are. Photons lie in packets; all of a packet were followed through the same
//! matter. Packets are brought up to newer matter from the first one on, so that they form a few runs.

use std::sync::Arc;

use super::matter::Matter;

/// Photons of a packet; as in shaders/precomputed_transfer/find_stale.wgsl.
pub const PACKET: u32 = 4096;

/// Photons one after the other that are in the sums as they go through the same matter.
struct Run {
    /// The photon behind the last one.
    end: u64,
    matter: Arc<Matter>,
}

/// Photons that are in the sums.
#[derive(Default)]
pub struct Packets(Vec<Run>);

/// Photons at work together.
pub struct Window {
    /// When they are done with, photons before this one are `to`'s.
    pub end: u64,
    pub first: u64,
    /// How many are at work: all from the first on, or those of the list.
    pub count: u32,
    /// In the sums they are this matter's; `None`: they are not there yet.
    pub from: Option<Arc<Matter>>,
    pub to: Arc<Matter>,
    /// Whether they are being taken out of the sums.
    pub leaving: bool,
    /// Whether they have set out.
    pub entered: bool,
}

impl Packets {
    /// How many photons there are.
    pub fn done(&self) -> u64 {
        self.0.last().map_or(0, |run| run.end)
    }

    /// Photons in runs: first one, the one behind the last, and whose they are.
    pub fn runs(&self) -> impl Iterator<Item = ([u64; 2], &Arc<Matter>)> {
        let firsts = std::iter::once(0).chain(self.0.iter().map(|run| run.end));
        firsts.zip(&self.0).map(|(first, run)| ([first, run.end], &run.matter))
    }

    /// The first run of photons that are other matter's.
    pub fn behind(&self, matter: &Arc<Matter>) -> Option<([u64; 2], Arc<Matter>)> {
        let mut others = self.runs().filter(|(_, of)| !Arc::ptr_eq(of, matter));
        others.next().map(|(range, of)| (range, of.clone()))
    }

    /// How many photons are this matter's.
    pub fn current(&self, matter: &Arc<Matter>) -> u64 {
        self.behind(matter).map_or(self.done(), |([first, _], _)| first)
    }

    /// All photons before `end` are the matter's now.
    pub fn take_over(&mut self, end: u64, matter: &Arc<Matter>) {
        self.0.retain(|run| run.end > end && !Arc::ptr_eq(&run.matter, matter));
        self.0.insert(0, Run { end, matter: matter.clone() });
    }
}

/// From the packet with photon `first` on, no farther than to `end`: where the packets end that have no more
/// stale photons than `most` together, or the first packet, and how many those are. `stale`: of each packet
/// its stale photons.
pub fn window(stale: &[u32], [first, end]: [u64; 2], most: u32) -> (u64, u32) {
    let mut reached = first;
    let mut count = 0;
    while reached < end {
        let packet = reached / u64::from(PACKET);
        let more = stale.get(packet as usize).copied().unwrap_or(0);
        if reached > first && count + more > most {
            break;
        }
        count += more;
        reached = ((packet + 1) * u64::from(PACKET)).min(end);
    }
    (reached, count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shaders;

    #[test]
    fn packets_are_those_of_the_shader() {
        assert!(shaders::FIND_STALE.contains(&format!("const PACKET = {PACKET}u;")));
    }

    #[test]
    fn windows_hold_whole_packets_and_no_more_than_there_is_room_for() {
        let p = u64::from(PACKET);
        let stale = [10, 0, 20, 5, 4000];
        assert_eq!(window(&stale, [0, 5 * p], 30), (3 * p, 30));
        assert_eq!(window(&stale, [3 * p, 5 * p], 30), (4 * p, 5));
        assert_eq!(window(&stale, [4 * p, 4 * p + 7], 30), (4 * p + 7, 4000));
        assert_eq!(window(&stale, [0, p + 3], 4096), (p + 3, 10));
        assert_eq!(window(&stale, [p, p], 4096), (p, 0));
    }
}
