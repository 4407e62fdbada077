import { SliderField } from "../app/controls";
import type { Illumination } from "../generated/proto";
import { session } from "../session/engine";

/** The server's bounds, cells along the volume's longest edge. */
const CELLS = { from: 4, to: 256 };
const SLIDER_END = 128;

/** How finely methods that look direct light up keep it. */
export function ShadowGridField({ illumination }: { illumination: Illumination }) {
  return <SliderField label="Shadow grid" hint="Places along the volume's longest edge at which shadows of lamps and suns are looked up" value={illumination.direct_grid} min={CELLS.from} max={CELLS.to} sliderMax={SLIDER_END} step={1} testId="direct-grid" onChange={(cells) => session.edit({ illumination: { direct_grid: Math.round(cells) } }, "direct-grid")} />;
}
