/** Cuts the volume open: a box along its axes, and planes. */

import { Button, RangeSlider, Switch } from "@mantine/core";
import { Row, Section } from "../app/controls";
import { Icon } from "../app/Icon";
import { MAX_CLIP_PLANES, type Clip } from "../generated/proto";
import { rounded, type Triple } from "../scene/vec";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { currentCamera } from "../viewport/actions";
import { planeFacing } from "./clipPlanes";
import { withoutEffect } from "./methods";
import { PlaneRows, setPlanes } from "./PlaneRows";
import { ShownVolume } from "./ShownVolume";

const WHOLE: [Triple, Triple] = [[0, 0, 0], [1, 1, 1]];
/** Thinnest slab that is kept, share of the edge. */
const MIN_SLAB = 0.005;

const gridNames = ["x", "y", "z"] as const;
const anatomicalNames = ["Right – left", "Front – back", "Feet – head"] as const;

/** The box with one axis changed; null where nothing is cut. */
export function withAxis(box: NonNullable<Clip["box"]>, axis: 0 | 1 | 2, [low, high]: [number, number]): Clip["box"] | null {
  const next: [Triple, Triple] = [[...box[0]], [...box[1]]];
  next[0][axis] = rounded(low, 4);
  next[1][axis] = rounded(high, 4);
  return next[0].every((x) => x === 0) && next[1].every((x) => x === 1) ? null : next;
}

export function ClipPanel() {
  const clip = useSession((state) => state.scene?.clip);
  const anatomical = useSession((state) => state.dataset?.anatomical ?? false);
  const method = useSession((state) => state.scene?.illumination.method);
  if (!clip || method === undefined) return null;
  const shadowsLack = withoutEffect(method, "clip shadows");
  const cut = clip.box !== undefined || clip.planes.length > 0;
  const box = clip.box ?? WHOLE;
  const names = anatomical ? anatomicalNames : gridNames;
  const actions = (
    <div className="section-actions">
      {cut && <button type="button" className="text-button" title="Cut nothing away" onClick={() => session.edit({ clip: { box: null, planes: [] } })} data-testid="clip-reset">Whole</button>}
      <Button variant="default" size="compact-xs" leftSection={<Icon name="plus" size={11} />} title="A plane that cuts away the half that is nearer to you" disabled={clip.planes.length >= MAX_CLIP_PLANES} onClick={() => setPlanes([...clip.planes, planeFacing(currentCamera())])} data-testid="clip-plane-add">Plane</Button>
    </div>
  );
  return (
    <Section id="clip" title="Clip" fields={["clip"]} actions={actions}>
      {([0, 1, 2] as const).map((axis) => (
        <Row key={axis} label={names[axis]}>
          <RangeSlider
            className="row-slider"
            min={0}
            max={1}
            step={0.002}
            minRange={MIN_SLAB}
            label={null}
            value={[box[0][axis], box[1][axis]]}
            thumbFromLabel={`${names[axis]} from`}
            thumbToLabel={`${names[axis]} to`}
            data-testid={`clip-${gridNames[axis]}`}
            onChange={(range) => {
              session.beginGesture();
              session.edit({ clip: { box: withAxis(box, axis, range) } });
            }}
            onChangeEnd={() => session.endGesture()}
          />
          <span className="number clip-range">{Math.round(box[0][axis] * 100)}–{Math.round(box[1][axis] * 100)} %</span>
        </Row>
      ))}
      <PlaneRows planes={clip.planes} />
      <ShownVolume />
      <Row label="Shadows" hint="Whether what is cut away still blocks light">
        <Switch checked={clip.shadows} label="Also from cut parts" data-testid="clip-shadows" onChange={(event) => session.edit({ clip: { shadows: event.currentTarget.checked } })} />
      </Row>
      {shadowsLack !== null && <p className="hint row-hint" data-testid="clip-shadows-note">{shadowsLack}</p>}
    </Section>
  );
}
