/** Cuts the volume open: a box along its axes, and planes. */

import { Button, RangeSlider, Switch } from "@mantine/core";
import { Row, Section } from "../app/controls";
import { Icon } from "../app/Icon";
import { useUi } from "../app/uiStore";
import { MAX_CLIP_PLANES } from "../generated/proto";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { currentCamera } from "../viewport/actions";
import { anatomicalNames, gridNames, MIN_SLAB, WHOLE, withAxis } from "./clipBox";
import { planeFacing } from "./clipPlanes";
import { withoutEffect } from "./methods";
import { PlaneRows, setPlanes } from "./PlaneRows";
import { ShownVolume } from "./ShownVolume";

export function ClipPanel() {
  const clip = useSession((state) => state.scene?.clip);
  const anatomical = useSession((state) => state.dataset?.anatomical ?? false);
  const method = useSession((state) => state.scene?.illumination.method);
  const handles = useUi((ui) => ui.clipHandles);
  if (!clip || method === undefined) return null;
  const shadowsLack = withoutEffect(method, "clip shadows");
  const cut = clip.box !== undefined || clip.planes.length > 0;
  const box = clip.box ?? WHOLE;
  const names = anatomical ? anatomicalNames : gridNames;
  const actions = (
    <div className="section-actions">
      {cut && <button type="button" className="text-button" title="Cut nothing away" onClick={() => session.edit({ clip: { box: null, planes: [] } })} data-testid="clip-reset">Whole</button>}
      <Button variant={handles ? "light" : "default"} size="compact-xs" title="Pull the box and the planes in the picture (C)" aria-pressed={handles} onClick={() => useUi.setState({ clipHandles: !handles })} data-testid="clip-handles">Handles</Button>
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
