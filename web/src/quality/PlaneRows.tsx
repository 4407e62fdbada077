/** The planes that cut the volume, each with how much it cuts away. */

import { Slider } from "@mantine/core";
import { IconButton, Row } from "../app/controls";
import type { Clip, ClipPlane } from "../generated/proto";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { currentCamera } from "../viewport/actions";
import { cutShare, flipped, halfEdges, planeFacing, withCut } from "./clipPlanes";

export const setPlanes = (planes: ClipPlane[], key: string | null = null): void => session.edit({ clip: { planes } }, key);

export function PlaneRows({ planes }: Pick<Clip, "planes">) {
  const dataset = useSession((state) => state.dataset);
  const spacing = useSession((state) => state.scene?.spacing);
  const half = halfEdges(dataset, spacing);
  const change = (index: number, to: ClipPlane) => setPlanes(planes.map((plane, i) => (i === index ? to : plane)));
  return planes.map((plane, index) => {
    const share = cutShare(plane, half);
    return (
      <div key={index} className="plane" data-testid={`clip-plane-${index}`}>
        <div className="plane-head">
          <span className="row-label">Plane {index + 1}</span>
          <button type="button" className="text-button" title="Cut away what is nearer to you, straight from where you look" onClick={() => change(index, withCut(planeFacing(currentCamera()), share, half))} data-testid={`clip-plane-face-${index}`}>Across my view</button>
          <button type="button" className="text-button" title="Keep the part that was cut away instead" onClick={() => change(index, flipped(plane))} data-testid={`clip-plane-flip-${index}`}>Other side</button>
          <IconButton icon="close" label="Remove the plane" testId={`clip-plane-remove-${index}`} onClick={() => setPlanes(planes.filter((_, i) => i !== index))} />
        </div>
        <Row label="Cut away">
          <Slider
            className="row-slider"
            min={0}
            max={1}
            step={0.002}
            label={null}
            value={share}
            thumbLabel={`Plane ${index + 1}: share cut away`}
            data-testid={`clip-plane-cut-${index}`}
            onChange={(cut) => {
              session.beginGesture();
              change(index, withCut(plane, cut, half));
            }}
            onChangeEnd={() => session.endGesture()}
          />
          <span className="number clip-range">{Math.round(share * 100)} %</span>
        </Row>
      </div>
    );
  });
}
