/** Says where less than the whole volume at full resolution is shown, and lets one choose. */

import { session } from "../session/engine";
import { useSession } from "../session/store";
import { currentCamera } from "../viewport/actions";
import { halfEdges } from "./clipPlanes";
import { regionInView } from "./region";

/** Full resolution for the clip box, or for what is seen around the pivot. */
function showHere(): void {
  const { scene, dataset } = useSession.getState();
  if (scene) session.edit({ volume: { region: regionInView(currentCamera(), scene.clip, halfEdges(dataset, scene.spacing)) } });
}

const showAll = (): void => session.edit({ volume: { region: null } });

export function ShownVolume() {
  const shown = useSession((state) => state.shown);
  if (!shown) return null;
  return (
    <div className="row-hint" data-testid="shown-volume" data-level={shown.level}>
      <p className="hint" role="status">{shown.notice}</p>
      {shown.level > 0 && <button type="button" className="text-button" title="The clip box, or what is seen around the pivot, as fine as it fits" onClick={showHere} data-testid="shown-region">Full resolution here</button>}
      {" "}
      {shown.region !== undefined && <button type="button" className="text-button" onClick={showAll} data-testid="shown-whole">Whole volume</button>}
    </div>
  );
}
