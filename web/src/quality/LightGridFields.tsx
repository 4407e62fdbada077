/** Settings of `convection_diffusion`: the grid, how light is carried over it, how it is spread. */

import { NativeSelect } from "@mantine/core";
import { Row, SliderField } from "../app/controls";
import type { Illumination } from "../generated/proto";
import { session } from "../session/engine";
import { diffusions, transports, whyNotDiffused } from "./lightGrid";

/** Steps in time at the end of the slider. */
const SLIDER_STEPS = 30;
/** Residuals at the ends of the slider. */
const RESIDUALS = { from: 1e-5, to: 0.5 };

export function LightGridFields({ illumination, scatteredOnce }: { illumination: Illumination; scatteredOnce: boolean }) {
  const lack = whyNotDiffused(illumination, scatteredOnce);
  const diffused = illumination.diffusion !== "none" && !scatteredOnce;
  return (
    <>
      <SliderField label="Light grid" hint="Cells of the light grid for each voxel along an axis: finer shadows, more time and memory" value={illumination.light_grid} min={0.01} max={2} sliderMax={1} step={0.05} toSlider={Math.log2} fromSlider={(x) => 2 ** x} testId="light-grid" onChange={(light_grid) => session.edit({ illumination: { light_grid } }, "light-grid")} />
      <SliderField label="Bands" hint="Bands of diffused light: 1 is its mean, 2 tells where it flows to, which surfaces and forward scattering see" value={Math.min(illumination.light_bands, 2)} min={1} max={2} step={1} testId="light-bands" onChange={(bands) => session.edit({ illumination: { light_bands: Math.round(bands) } }, "light-bands")} />
      <Row label="Carried" hint="How light gets from its source to each cell">
        <NativeSelect aria-label="Light transport" value={illumination.transport} data={[...transports]} data-testid="light-transport" onChange={(event) => session.edit({ illumination: { transport: event.currentTarget.value } })} />
      </Row>
      {illumination.transport === "explicit" && <SliderField label="Steps" hint="Steps in time of each layer of cells; too few lose light" value={illumination.explicit_steps} min={1} max={100} sliderMax={SLIDER_STEPS} step={1} testId="explicit-steps" onChange={(steps) => session.edit({ illumination: { explicit_steps: Math.round(steps) } }, "explicit-steps")} />}
      <Row label="Diffusion" hint="What becomes of light that is scattered">
        <NativeSelect aria-label="Diffusion" value={illumination.diffusion} data={[...diffusions]} data-testid="diffusion" onChange={(event) => session.edit({ illumination: { diffusion: event.currentTarget.value } })} />
      </Row>
      {diffused && illumination.diffusion === "heat" && <SliderField label="Spread" hint="How far light spreads in vacuum, in longest edges of the volume" value={illumination.heat_spread} min={0} max={1} sliderMax={0.3} step={0.005} testId="heat-spread" onChange={(heat_spread) => session.edit({ illumination: { heat_spread } }, "heat-spread")} />}
      {diffused && <SliderField label="Residual" hint="How exactly diffusion is solved before the light is final" value={illumination.max_residual} min={RESIDUALS.from} max={RESIDUALS.to} step={0.00001} digits={5} toSlider={Math.log10} fromSlider={(x) => 10 ** x} testId="max-residual" onChange={(max_residual) => session.edit({ illumination: { max_residual } }, "max-residual")} />}
      {lack !== null && <p className="hint row-hint" data-testid="diffusion-note">{lack}</p>}
    </>
  );
}
