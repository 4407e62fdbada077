/** The selected point in numbers. */

import { NativeSelect } from "@mantine/core";
import { useEffect, useRef } from "react";
import { ColorField, IconButton, NumberField, Row } from "../app/controls";
import { useUi } from "../app/uiStore";
import type { TransferFunctionPoint } from "../generated/proto";
import { hueOf, strengthOf, withStrength } from "../scene/colour";
import { useSession } from "../session/store";
import { removeSelected, setPoints } from "./curve";
import { extinctionOf, inUnit, opacityOf, withOpacity } from "./opacity";
import { changePoints, movePoint, withMaterial } from "./points";
import { positionOf, valueOf, type Range } from "./valueAxis";

/** Largest extinction and emission that can be typed; the scene's own limit. */
const MAX_MAGNITUDE = 1e9;

export function PointFields({ points, range, whole, focusRequest }: {
  points: readonly TransferFunctionPoint[];
  range: Range;
  /** Values are whole numbers. */
  whole: boolean;
  /** Changes when the value field is to take the focus. */
  focusRequest: number;
}) {
  const selected = useUi((ui) => ui.selectedPoints);
  const materials = useSession((state) => state.scene?.materials);
  const fields = useRef<HTMLDivElement>(null);
  useEffect(() => {
    if (focusRequest === 0) return;
    const input = fields.current?.querySelector("input");
    input?.focus();
    input?.select();
  }, [focusRequest]);

  // What several points share is that of the first, and is given to all.
  const [index] = selected;
  const point = index === undefined ? undefined : points[index];
  if (index === undefined || !point) {
    return <p className="hint tf-fields-empty" data-testid="tf-no-point">Select a point to change its colour and numbers, or double-click to add one. Draw a rectangle to select several.</p>;
  }
  const several = selected.length > 1;
  const change = (key: string, to: (point: TransferFunctionPoint) => TransferFunctionPoint) => setPoints(changePoints(points, selected, to), `${key}-${selected.join("-")}`);
  const unit = point.extinction === undefined ? "opacity" : "extinction";
  const names = ["", ...new Set(["default", ...Object.keys(materials ?? {})])];
  return (
    <div className="tf-fields" ref={fields} data-testid="tf-fields">
      <Row label={several ? "Selected" : "Value"}>
        {several
          ? <span className="tf-several" data-testid="tf-several">{selected.length} points</span>
          : <NumberField label="Value" value={valueOf(point.s, range)} step={(range[1] - range[0]) / 200} digits={6} whole={whole} width={84} testId="tf-value" onChange={(value) => setPoints(movePoint(points, index, positionOf(value, range), null), `value-${index}`)} />}
        <ColorField label="Colour" color={point.albedo} testId="tf-colour" onChange={(albedo) => change("albedo", (p) => ({ ...p, albedo }))} />
        <IconButton icon="trash" label={several ? "Remove these points" : "Remove this point"} hotkey="Delete" disabled={points.length < 2} testId="tf-remove" onClick={removeSelected} />
      </Row>
      <Row label="Matter" hint="Opacity of 0.01 world units (the volume's longest edge is 1), or extinction per world unit">
        <NativeSelect className="unit-select" aria-label="Given as" value={unit} data-testid="tf-unit" data={[{ value: "opacity", label: "Opacity" }, { value: "extinction", label: "Extinction" }]} onChange={(event) => change("unit", (p) => inUnit(p, event.currentTarget.value === "opacity" ? "opacity" : "extinction"))} />
        {unit === "opacity"
          ? <NumberField label="Opacity" value={opacityOf(point)} min={0} max={1} step={0.01} width={84} testId="tf-opacity" onChange={(opacity) => change("opacity", (p) => withOpacity(p, opacity))} />
          : <NumberField label="Extinction" value={extinctionOf(point)} min={0} max={MAX_MAGNITUDE} step={1} digits={6} width={84} testId="tf-extinction" onChange={(extinction) => change("extinction", (p) => ({ ...p, extinction }))} />}
      </Row>
      <Row label="Material" hint="Holds from this point up to the next">
        <NativeSelect aria-label="Material" value={point.material ?? ""} data-testid="tf-material" data={names.map((name) => ({ value: name, label: name === "" ? "none (isotropic)" : name }))} onChange={(event) => {
          const name = event.currentTarget.value;
          change("material", (p) => withMaterial(p, name === "" ? null : name));
        }} />
      </Row>
      <Row label="Emission" hint="Emitted radiance; it counts where the colour absorbs, so a white point does not glow">
        <NumberField label="Emission" value={strengthOf(point.emission)} min={0} max={MAX_MAGNITUDE} step={0.1} width={84} testId="tf-emission" onChange={(strength) => change("emission", (p) => ({ ...p, emission: withStrength(p.emission, strength) }))} />
        {strengthOf(point.emission) > 0 && <ColorField label="Emission colour" color={hueOf(point.emission)} testId="tf-emission-colour" onChange={(hue) => change("emission", (p) => ({ ...p, emission: withStrength(hue, strengthOf(p.emission)) }))} />}
      </Row>
    </div>
  );
}
