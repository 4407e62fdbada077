/** The scene's materials; points of the transfer function refer to them by name. */

import { Button, NativeSelect } from "@mantine/core";
import { IconButton, NumberField, Row, Section, SliderField } from "../app/controls";
import { Icon } from "../app/Icon";
import type { Brdf, Material, Phase } from "../generated/proto";
import { diffPatch } from "../scene/mergePatch";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { asymmetryOf, brdfNames, brdfOf, freeName, MAX_ASYMMETRY, phaseNames, phaseOf, withSurface } from "./materials";

const options = (names: Record<string, string>) => Object.entries(names).map(([value, label]) => ({ value, label }));
const isotropic: Material = { phase: { type: "isotropic" }, surface: 0 };

export function MaterialsPanel() {
  const materials = useSession((state) => state.scene?.materials);
  const points = useSession((state) => state.scene?.transfer_function.points);
  if (!materials || !points) return null;
  const names = Object.keys(materials);
  const change = (name: string, to: Material) => {
    const patch = diffPatch(materials[name] ?? {}, to);
    session.edit({ materials: { [name]: patch } }, `material-${name}`);
  };
  const add = <Button variant="default" size="compact-xs" leftSection={<Icon name="plus" size={11} />} onClick={() => session.edit({ materials: { [freeName(names)]: isotropic } })} data-testid="material-add">Add</Button>;
  return (
    <Section id="materials" title="Materials" fields={["materials"]} actions={add}>
      {names.length === 0 && <p className="hint">None: everything scatters evenly in all directions. Add one, then choose it at a point of the transfer function.</p>}
      {names.map((name) => {
        const material = materials[name];
        const used = points.some((point) => point.material === name);
        return material && <MaterialFields key={name} name={name} material={material} used={used} onChange={(to) => change(name, to)} />;
      })}
    </Section>
  );
}

function MaterialFields({ name, material, used, onChange }: { name: string; material: Material; used: boolean; onChange: (material: Material) => void }) {
  const { phase, surface, brdf } = material;
  return (
    <div className="material" data-testid={`material-${name}`}>
      <div className="tile-head">
        <span className="tile-name">{name}</span>
        {!used && <span className="dim">unused</span>}
        <IconButton icon="trash" label={used ? "In use: choose another material at its points first" : "Remove"} disabled={used} testId={`material-remove-${name}`} onClick={() => session.edit({ materials: { [name]: null } })} />
      </div>
      <Row label="Phase" hint="How light scatters inside matter">
        <NativeSelect aria-label="Phase function" value={phase.type} data={options(phaseNames)} data-testid="material-phase" onChange={(event) => onChange({ ...material, phase: phaseOf(event.currentTarget.value as Phase["type"], asymmetryOf(phase)) })} />
      </Row>
      {phase.type !== "isotropic" && (
        <SliderField label="Asymmetry" hint="Above 0 light goes on forwards, below 0 it turns back" value={asymmetryOf(phase)} min={-MAX_ASYMMETRY} max={MAX_ASYMMETRY} step={0.05} testId="material-asymmetry" onChange={(asymmetry) => onChange({ ...material, phase: phaseOf(phase.type, asymmetry) })} />
      )}
      <SliderField label="Surface" hint="Weight of surface reflection against scattering inside" value={surface} min={0} max={1} step={0.05} testId="material-surface" onChange={(weight) => onChange(withSurface(material, weight))} />
      {surface > 0 && brdf && <BrdfFields brdf={brdf} onChange={(to) => onChange({ ...material, brdf: to })} />}
    </div>
  );
}

function BrdfFields({ brdf, onChange }: { brdf: Brdf; onChange: (brdf: Brdf) => void }) {
  return (
    <>
      <Row label="Reflection" hint="How the surface reflects; surfaces lie where the values change quickly">
        <NativeSelect aria-label="Reflection model" value={brdf.type} data={options(brdfNames)} data-testid="material-brdf" onChange={(event) => onChange(brdfOf(event.currentTarget.value as Brdf["type"], brdf.diffuse))} />
      </Row>
      <SliderField label="Diffuse" hint="Share of the light that a surface reflects evenly in all directions" value={brdf.diffuse} min={0} max={1} step={0.05} testId="material-diffuse" onChange={(diffuse) => onChange({ ...brdf, diffuse })} />
      {(brdf.type === "blinn_phong" || brdf.type === "ashikhmin_shirley") && (
        <SliderField label="Specular" hint="Share of the light that a surface reflects as a highlight" value={brdf.specular} min={0} max={1} step={0.01} testId="material-specular" onChange={(specular) => onChange({ ...brdf, specular })} />
      )}
      {brdf.type === "blinn_phong" && (
        <Row label="Exponent" hint="Larger: smaller and sharper highlights"><NumberField label="Exponent" value={brdf.exponent} min={0} max={1e4} step={5} testId="material-exponent" onChange={(exponent) => onChange({ ...brdf, exponent })} /></Row>
      )}
      {brdf.type === "ashikhmin_shirley" && (
        <Row label="Exponents" hint="Sharpness of the highlight along and across; larger is sharper">
          <NumberField label="First exponent" value={brdf.exponents[0]} min={0} max={1e4} step={5} testId="material-exponent-u" onChange={(u) => onChange({ ...brdf, exponents: [u, brdf.exponents[1]] })} />
          <NumberField label="Second exponent" value={brdf.exponents[1]} min={0} max={1e4} step={5} testId="material-exponent-v" onChange={(v) => onChange({ ...brdf, exponents: [brdf.exponents[0], v] })} />
        </Row>
      )}
      {brdf.type === "abc" && (
        <Row label="A, B, C" hint="Peak, width and fall-off of the highlight">
          <NumberField label="A: peak" value={brdf.a} min={0} max={1e6} width={56} testId="material-a" onChange={(a) => onChange({ ...brdf, a })} />
          <NumberField label="B: width" value={brdf.b} min={0} max={1e6} width={56} testId="material-b" onChange={(b) => onChange({ ...brdf, b })} />
          <NumberField label="C: fall-off" value={brdf.c} min={0} max={1e3} width={56} testId="material-c" onChange={(c) => onChange({ ...brdf, c })} />
        </Row>
      )}
    </>
  );
}
