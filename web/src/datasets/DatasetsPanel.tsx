/** Samples, own datasets and uploads. */

import { Button, FileButton, NativeSelect } from "@mantine/core";
import { useEffect, useState } from "react";
import { IconButton, Section } from "../app/controls";
import { Icon } from "../app/Icon";
import { sayError } from "../app/say";
import type { Dataset } from "../generated/proto";
import { ShownVolume } from "../quality/ShownVolume";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { formatDims } from "./format";
import { explore, refreshDatasets, removeDataset, showLeftovers, takeFiles, useDatasets } from "./store";
import { Thumbnail } from "./Thumbnail";
import { DatasetFacts, UploadTiles } from "./UploadTiles";

/** Browser tests put files here. */
const uploadInput = { "data-testid": "upload-input" } as object;

export function DatasetsPanel() {
  useEffect(() => void showLeftovers().catch(sayError), []);
  const list = useDatasets((state) => state.list);
  const error = useDatasets((state) => state.listError);
  const samples = list.filter((dataset) => dataset.sample);
  const mine = list.filter((dataset) => !dataset.sample).sort((a, b) => b.created_unix_millis - a.created_unix_millis);
  return (
    <>
      <div className="upload-bar">
        <FileButton multiple inputProps={uploadInput} onChange={(files) => void takeFiles(files).catch(sayError)}>
          {(props) => (
            <Button {...props} fullWidth variant="default" leftSection={<Icon name="upload" size={13} />} data-testid="upload-button">Upload a volume</Button>
          )}
        </FileButton>
        <p className="hint">or drop files anywhere: DICOM (files, a folder or a zip), NRRD, NIfTI, MetaImage, NumPy, VTI, TIFF, PNG slices, zipped OME-Zarr, raw, or a saved scene</p>
      </div>
      <UploadTiles />
      {error !== null && (
        <p className="note note-danger" role="alert">
          {error} <button type="button" className="text-button" onClick={() => void refreshDatasets()}>Try again</button>
        </p>
      )}
      {mine.length > 0 && (
        <Section id="mine" title="Uploaded">
          <ul className="cards" data-testid="datasets-mine">{mine.map((dataset) => <Card key={dataset.id} dataset={dataset} />)}</ul>
        </Section>
      )}
      <Section id="samples" title="Samples">
        <ul className="cards" data-testid="datasets-samples">{samples.map((dataset) => <Card key={dataset.id} dataset={dataset} />)}</ul>
      </Section>
    </>
  );
}

function Card({ dataset }: { dataset: Dataset }) {
  const current = useSession((state) => state.dataset?.id === dataset.id);
  const opening = useDatasets((state) => state.opening === dataset.id);
  const error = useDatasets((state) => (state.datasetError?.id === dataset.id ? state.datasetError.message : null));
  const [confirming, setConfirming] = useState(false);
  const [details, setDetails] = useState(false);
  return (
    <li className="card" data-current={current} data-testid={`dataset-${dataset.id}`}>
      <div className="card-row">
        <button type="button" className="card-open" title={`${dataset.name}, ${formatDims(dataset.dims)} ${dataset.voxel_type}`} onClick={() => void explore(dataset.id)} disabled={opening} data-testid={`open-${dataset.id}`}>
          <Thumbnail id={dataset.id} />
          <span className="card-text">
            <span className="card-name">{dataset.name}</span>
            <span className="dim number">{opening ? "Opening …" : `${formatDims(dataset.dims)} ${dataset.voxel_type}`}</span>
          </span>
        </button>
        <IconButton icon="chevron" label="Details" active={details} onClick={() => setDetails((is) => !is)} testId={`details-${dataset.id}`} />
        {!dataset.sample && <IconButton icon="trash" label="Delete" onClick={() => setConfirming(true)} testId={`delete-${dataset.id}`} />}
      </div>
      {confirming && (
        <div className="tile-actions confirm" role="alertdialog" aria-label={`Delete ${dataset.name}?`}>
          <span>Delete for everybody on this server?</span>
          <Button color="red" variant="light" onClick={() => void removeDataset(dataset.id)} data-testid="delete-confirm">Delete</Button>
          <Button variant="default" onClick={() => setConfirming(false)} data-testid="delete-keep">Keep</Button>
        </div>
      )}
      {error !== null && <p className="note note-danger" role="alert" data-testid="dataset-error">{error}</p>}
      {current && dataset.choices.length > 1 && <VolumeChoice choices={dataset.choices} />}
      {current && <ShownVolume />}
      {details && <DatasetFacts dataset={dataset} />}
    </li>
  );
}

/** Which of the open dataset's volumes is shown. */
function VolumeChoice({ choices }: { choices: readonly string[] }) {
  const index = useSession((state) => state.scene?.volume.index ?? 0);
  return (
    <NativeSelect aria-label="Volume" data-testid="volume-choice" value={String(index)}
      data={choices.map((label, choice) => ({ label, value: String(choice) }))}
      onChange={(event) => session.edit({ volume: { index: Number(event.currentTarget.value) } })} />
  );
}
