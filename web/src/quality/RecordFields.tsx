import { NativeSelect, Switch } from "@mantine/core";
import type { Illumination } from "../generated/proto";
import { session } from "../session/engine";
import { Row, SliderField } from "../app/controls";
import { directionChoices, formChoices, lookupChoices, MAX_BANDS, MAX_EXCHANGES, MAX_RECORDS, MIN_RECORDS } from "./records";
import { ShadowGridField } from "./ShadowGridField";

/** Where image-based lighting keeps light, how well, and in which form. */
export function RecordFields({ illumination }: { illumination: Illumination }) {
  const edit = (patch: Partial<Illumination>, undo?: string) => session.edit({ illumination: patch }, undo);
  return (
    <>
      <SliderField label="Records" hint="Places along the longest edge at which arriving light is kept; more show finer shadows" value={illumination.records} min={MIN_RECORDS} max={MAX_RECORDS} step={1} testId="records" onChange={(records) => edit({ records: Math.round(records) }, "records")} />
      {illumination.record_form === "product" && <ShadowGridField illumination={illumination} />}
      <Row label="Directions" hint="Directions in which each record looks for light of the environment">
        <NativeSelect aria-label="Directions of records" value={String(illumination.record_directions)} data={[...directionChoices]} data-testid="record-directions" onChange={(event) => edit({ record_directions: Number(event.currentTarget.value) })} />
      </Row>
      <SliderField label="Bands" hint="Bands of spherical harmonics that are kept where phase functions or surfaces tell directions apart" value={illumination.record_bands} min={1} max={MAX_BANDS} step={1} testId="record-bands" onChange={(bands) => edit({ record_bands: Math.round(bands) }, "bands")} />
      {illumination.record_form === "product" && <SliderField label="Exchanges" hint="How often records exchange scattered light: each time adds an order of scattering; 0 shows light that is scattered once" value={illumination.record_exchange} min={0} max={MAX_EXCHANGES} step={1} testId="record-exchange" onChange={(rounds) => edit({ record_exchange: Math.round(rounds) }, "exchanges")} />}
      <Row label="Form" hint="What a record holds; the last three are the published method's">
        <NativeSelect aria-label="Form of records" value={illumination.record_form} data={[...formChoices]} data-testid="record-form" onChange={(event) => {
          const chosen = formChoices.find((choice) => choice.value === event.currentTarget.value);
          if (chosen) edit({ record_form: chosen.value });
        }} />
      </Row>
      <Row label="Lookup" hint="Whether a place in matter reads eight records around it or the one whose cell holds it">
        <NativeSelect aria-label="Lookup of records" value={illumination.record_lookup} data={[...lookupChoices]} data-testid="record-lookup" onChange={(event) => {
          const chosen = lookupChoices.find((choice) => choice.value === event.currentTarget.value);
          if (chosen) edit({ record_lookup: chosen.value });
        }} />
      </Row>
      <Row label="Ringing" hint="A window over the bands: softer light without dark rings around bright spots">
        <Switch checked={illumination.record_window} label="Damp" data-testid="record-window" onChange={(event) => edit({ record_window: event.currentTarget.checked })} />
      </Row>
    </>
  );
}
