/** The histogram of what the clip region keeps, kept in step with the region. */

import { useEffect, useState } from "react";
import { getRegionHistogram } from "../api/rest";
import type { RegionHistogram, SceneFile } from "../generated/proto";
import { useSession } from "../session/store";
import { wordsOf } from "../session/words";

/** The clip region rests this long before it is counted anew, milliseconds. */
const REST_MILLIS = 150;

/** What decides which voxels are kept; null where all are. */
export function regionOf(sessionId: string | null, scene: SceneFile | null): string | null {
  if (!sessionId || !scene) return null;
  const { volume, clip, spacing } = scene;
  if (clip.box === undefined && clip.planes.length === 0) return null;
  // Planes lie in the world: other spacing, other voxels. Interpolation makes none.
  return JSON.stringify([sessionId, { ...volume, filter: undefined }, clip.box, clip.planes, spacing]);
}

/**
 * The histogram of the clip region while it is wanted; null while nothing is cut away or nothing
 * has arrived. Until the answer to a new region comes the one before stays; answers to regions that
 * are no longer shown are dropped.
 */
export function useRegionHistogram(wanted: boolean): RegionHistogram | null {
  const sessionId = useSession((state) => state.sessionId);
  const region = useSession((state) => (wanted ? regionOf(state.sessionId, state.scene) : null));
  // The service answers for the scene it has: every edit has to be there first.
  const settled = useSession((state) => state.settled && state.link === "open");
  const dataset = useSession((state) => state.dataset?.id);
  const [known, setKnown] = useState<{ region: string; dataset: string | undefined; histogram: RegionHistogram } | null>(null);
  const isKnown = known !== null && known.region === region;

  useEffect(() => {
    if (region === null || sessionId === null || isKnown || !settled) return;
    const stop = new AbortController();
    const timer = window.setTimeout(() => {
      getRegionHistogram(sessionId, stop.signal).then(
        (histogram) => stop.signal.aborted || setKnown({ region, dataset, histogram }),
        (error: unknown) => stop.signal.aborted || useSession.setState({ fieldError: { field: "transfer_function", message: `The histogram of what is in view did not arrive: ${wordsOf(error)}` } }),
      );
    }, REST_MILLIS);
    return () => {
      window.clearTimeout(timer);
      stop.abort();
    };
  }, [region, sessionId, isKnown, settled, dataset]);

  return region !== null && known?.dataset === dataset ? known?.histogram ?? null : null;
}
