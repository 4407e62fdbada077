/** Cuts the volume open along its axes. */

import { RangeSlider, Switch } from "@mantine/core";
import { Row, Section } from "../app/controls";
import type { Clip } from "../generated/proto";
import { rounded, type Triple } from "../scene/vec";
import { session } from "../session/engine";
import { useSession } from "../session/store";

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
  if (!clip) return null;
  const box = clip.box ?? WHOLE;
  const names = anatomical ? anatomicalNames : gridNames;
  const reset = clip.box && <button type="button" className="text-button" onClick={() => session.edit({ clip: { box: null } })} data-testid="clip-reset">Whole</button>;
  return (
    <Section id="clip" title="Clip" fields={["clip"]} actions={reset}>
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
      <Row label="Shadows" hint="Whether what is cut away still blocks light">
        <Switch checked={clip.shadows} label="Cut parts still cast shadows" data-testid="clip-shadows" onChange={(event) => session.edit({ clip: { shadows: event.currentTarget.checked } })} />
      </Row>
    </Section>
  );
}
