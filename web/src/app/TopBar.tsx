/** Name, dataset, method, and what concerns the scene as a whole. */

import { ActionIcon, FileButton, Menu, NativeSelect, Select, Tooltip } from "@mantine/core";
import { useState } from "react";
import { explore, takeFiles, useDatasets } from "../datasets/store";
import type { Method } from "../generated/proto";
import { chooseMethod, meanRadiance, pictureOfScene } from "../lights/environments";
import { useEnvironments } from "../lights/environmentStore";
import { labelOf, methodChoices, shortcoming } from "../quality/methods";
import { session } from "../session/engine";
import { isWatching, useSession } from "../session/store";
import { FieldNote, IconButton } from "./controls";
import { copySceneLink, copySessionLink, copyWatchLink, saveScene } from "./files";
import { Icon } from "./Icon";
import { sayError } from "./say";
import { saySideEffect } from "./sideEffect";
import { isOpen, useUi } from "./uiStore";
import { useTheme } from "./useTheme";

export function TopBar() {
  const canUndo = useSession((state) => state.canUndo);
  const canRedo = useSession((state) => state.canRedo);
  const watching = useSession(isWatching);
  const hasScene = useSession((state) => state.scene !== null);
  const left = useUi((ui) => isOpen(ui, "left"));
  const right = useUi((ui) => isOpen(ui, "right"));
  const toggle = useUi((ui) => ui.togglePanel);
  const { dark, toggle: toggleTheme } = useTheme();
  return (
    <header className="top-bar" data-testid="top-bar">
      <IconButton icon="panelLeft" label="Datasets" hotkey="[" active={left} onClick={() => toggle("left")} testId="toggle-left" />
      <h1 className="wordmark">Tyndall</h1>
      <DatasetSelect />
      <MethodSelect />
      <span className="top-gap" />
      {!watching && (
        <>
          <IconButton icon="undo" label="Undo" hotkey="Z" disabled={!canUndo} onClick={() => session.undo()} testId="undo" />
          <IconButton icon="redo" label="Redo" hotkey="Shift Z" disabled={!canRedo} onClick={() => session.redo()} testId="redo" />
          <span className="top-rule" />
        </>
      )}
      <FileButton accept=".json,application/json" inputProps={sceneInput} onChange={(file) => file && void takeFiles([file]).catch(sayError)}>
        {(props) => <IconButton icon="open" label="Open a scene file" testId="open-scene" {...props} />}
      </FileButton>
      <IconButton icon="save" label="Save the scene as a file" disabled={!hasScene} onClick={saveScene} testId="save-scene" />
      <ShareMenu />
      <span className="top-rule" />
      <IconButton icon="grid" label="Sessions on this server" hotkey="G" onClick={() => useUi.setState({ galleryOpen: true })} testId="gallery-open" />
      <IconButton icon={dark ? "sun" : "moon"} label={dark ? "Light theme, for projectors and print" : "Dark theme"} onClick={toggleTheme} testId="toggle-theme" />
      <IconButton icon="help" label="Keys and gestures" hotkey="?" onClick={() => useUi.setState({ helpOpen: true })} testId="help" />
      <IconButton icon="panelRight" label="Transfer function and lights" hotkey="]" active={right} onClick={() => toggle("right")} testId="toggle-right" />
    </header>
  );
}

/** Links to what is on screen, each with what it lets others do. */
function ShareMenu() {
  const watching = useSession(isWatching);
  const open = useSession((state) => state.link === "open" && state.scene !== null);
  const links = [
    ...(watching ? [] : [{ id: "session", label: "Link to this session", gives: "Others edit with you; each has a view of their own.", copy: copySessionLink }]),
    { id: "watch", label: "Link for watching", gives: "Others see every edit, in a view of their own.", copy: () => copyWatchLink() },
    { id: "scene", label: "Link to this scene", gives: "As it is now; it opens as a session of its own.", copy: copySceneLink },
  ];
  return (
    <Menu position="bottom-end" width={345} withinPortal>
      <Menu.Target>
        <ActionIcon color="gray" disabled={!open} aria-label="Share" title="Share: links to this session and this scene" data-testid="share"><Icon name="share" /></ActionIcon>
      </Menu.Target>
      <Menu.Dropdown>
        {links.map(({ id, label, gives, copy }) => (
          <Menu.Item key={id} onClick={() => void copy().catch(sayError)} data-testid={`share-${id}`}>
            {label}
            <span className="share-gives">{gives}</span>
          </Menu.Item>
        ))}
      </Menu.Dropdown>
    </Menu>
  );
}

/** Browser tests put files here. */
const sceneInput = { "data-testid": "scene-input" } as object;

/** Opens a dataset; says here what would be said at its card if the panel were open. */
async function choose(id: string): Promise<void> {
  const problem = id === "" ? null : await explore(id);
  if (problem !== null && !isOpen(useUi.getState(), "left")) sayError(new Error(problem));
}

function DatasetSelect() {
  const list = useDatasets((state) => state.list);
  const current = useSession((state) => state.dataset);
  const option = ({ id, name }: { id: string; name: string }) => ({ value: id, label: name });
  const groups = [
    { group: "Uploaded", items: list.filter((dataset) => !dataset.sample).map(option) },
    { group: "Samples", items: list.filter((dataset) => dataset.sample).map(option) },
  ].filter(({ items }) => items.length > 0);
  const known = list.some(({ id }) => id === current?.id);
  const data = [...(current && !known ? [option(current)] : []), ...(current ? [] : [{ value: "", label: "no dataset" }]), ...groups];
  return <NativeSelect aria-label="Dataset" className="top-dataset" value={current?.id ?? ""} data={data} data-testid="dataset-select" onChange={(event) => void choose(event.currentTarget.value)} />;
}

/** Changes the method; what it cannot show is taken out in the same edit, and said. */
function chooseAndSay(method: Method): void {
  const { scene } = useSession.getState();
  if (!scene) return;
  const { patch, tookPicture, switchedOff } = chooseMethod(scene, method, (image) => meanRadiance(useEnvironments.getState().list, image));
  session.edit(patch);
  if (tookPicture) saySideEffect("method", `${labelOf(method)} takes no environment picture: that light is uniform now.`, (now) => now.illumination.method === method && pictureOfScene(now) === null);
  if (switchedOff > 0) saySideEffect("method", `${labelOf(method)} takes distant light only: ${switchedOff === 1 ? "one light is" : `${switchedOff} lights are`} off now.`, (now) => now.illumination.method === method);
}

function MethodSelect() {
  const watching = useSession(isWatching);
  const method = useSession((state) => state.scene?.illumination.method);
  const built = useSession((state) => state.status?.methods);
  const [choosing, setChoosing] = useState(false);
  const sideEffect = useUi((ui) => (ui.sideEffect?.at === "method" ? ui.sideEffect.text : null));
  const lack = useSession((state) => (state.scene ? shortcoming(state.scene) : null));
  if (!method) return null;
  const choice = methodChoices.find((other) => other.method === method);
  const data = methodChoices.map((other) => ({ value: other.method, label: other.label, disabled: built !== undefined && !built.includes(other.method) }));
  return (
    <>
      <Tooltip disabled={choosing} label={<>{choice?.gives}<br /><span className="dim">{choice?.paper}</span></>}>
        <Select
          aria-label="Illumination method"
          className="top-method"
          data={data}
          value={method}
          allowDeselect={false}
          disabled={watching}
          withCheckIcon={false}
          comboboxProps={{ width: 330, position: "bottom-start" }}
          maxDropdownHeight={420}
          onDropdownOpen={() => setChoosing(true)}
          onDropdownClose={() => setChoosing(false)}
          data-testid="method-select"
          data-method={method}
          onChange={(next) => next && chooseAndSay(next)}
          renderOption={({ option }) => {
            const { gives, label } = methodChoices.find((other) => other.method === option.value) ?? { gives: "", label: option.label };
            return (
              <div className="method-option" data-testid={`method-${option.value}`} data-disabled={option.disabled}>
                <span>{label}</span>
                <span className="dim">{option.disabled ? "not built yet" : gives}</span>
              </div>
            );
          }}
        />
      </Tooltip>
      {sideEffect !== null && <span className="top-note" role="status" title={sideEffect} data-testid="method-side-effect">{sideEffect}</span>}
      {lack !== null && sideEffect === null && <span className="top-note" role="status" data-testid="method-note">{lack}</span>}
      <FieldNote fields={["illumination"]} />
    </>
  );
}
