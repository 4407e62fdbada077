/** Copy, paste, files and colour maps of the transfer function. */

import { ActionIcon, Button, Menu, Popover, Switch } from "@mantine/core";
import { useRef, useState } from "react";
import { Icon } from "../app/Icon";
import { sayError } from "../app/say";
import { colourAtOf, colourMapGroups, cssGradient } from "./colourMaps";
import { addOnCurve, copyToClipboard, openCurve, paint, pasteFromClipboard, saveCurve, selectAll } from "./curve";

export function CurveMenu() {
  const file = useRef<HTMLInputElement>(null);
  return (
    <>
      <input
        ref={file}
        hidden
        type="file"
        accept=".json,.vp,application/json"
        aria-label="Transfer function file"
        data-testid="tf-file"
        onChange={(event) => {
          const chosen = event.currentTarget.files?.[0];
          event.currentTarget.value = "";
          if (chosen) void openCurve(chosen).catch(sayError);
        }}
      />
      <Menu position="bottom-end" withinPortal>
        <Menu.Target>
          <ActionIcon variant="default" size={22} aria-label="Copy, paste, open and save the transfer function" title="Copy, paste, open and save" data-testid="tf-menu"><Icon name="more" size={14} /></ActionIcon>
        </Menu.Target>
        <Menu.Dropdown>
          <Menu.Item rightSection={<kbd>N</kbd>} onClick={() => addOnCurve()} data-testid="tf-add">Add a point</Menu.Item>
          <Menu.Divider />
          <Menu.Item rightSection={<kbd>Ctrl C</kbd>} onClick={() => void copyToClipboard()} data-testid="tf-copy">Copy</Menu.Item>
          <Menu.Item rightSection={<kbd>Ctrl V</kbd>} onClick={() => void pasteFromClipboard()} data-testid="tf-paste">Paste</Menu.Item>
          <Menu.Item rightSection={<kbd>Ctrl A</kbd>} onClick={selectAll} data-testid="tf-select-all">Select all points</Menu.Item>
          <Menu.Divider />
          <Menu.Item title="Saved here, by 3D Slicer (.vp) or by ParaView (.json)" onClick={() => file.current?.click()} data-testid="tf-open">Open a file …</Menu.Item>
          <Menu.Item title="With its values, colours and materials; tyndall render takes it as an edit" onClick={saveCurve} data-testid="tf-save">Save as a file</Menu.Item>
        </Menu.Dropdown>
      </Menu>
    </>
  );
}

/** Colour maps, each as a strip; one press lays it over the curve. */
export function ColourMaps() {
  const [opened, setOpened] = useState(false);
  const [reversed, setReversed] = useState(false);
  return (
    <Popover opened={opened} onChange={setOpened} position="bottom-end" withinPortal trapFocus>
      <Popover.Target>
        <Button variant="default" size="compact-xs" title="Colour maps; the opacities stay" onClick={() => setOpened((is) => !is)} data-testid="tf-colours">Colours</Button>
      </Popover.Target>
      <Popover.Dropdown p={10}>
        <div className="colour-maps">
          <Switch checked={reversed} label="Other way round" data-testid="tf-colours-reversed" onChange={(event) => setReversed(event.currentTarget.checked)} />
          {colourMapGroups.map(({ label, maps }) => (
            <section key={label}>
              <p>{label}</p>
              <ul aria-label={label}>
                {maps.map((map) => (
                  <li key={map.id}>
                    <button type="button" className="colour-map" data-testid={`tf-map-${map.id}`} onClick={() => {
                      paint(colourAtOf(map, reversed));
                      setOpened(false);
                    }}>
                      <span className="colour-map-strip" style={{ background: cssGradient(map, reversed) }} />
                      {map.label}
                    </button>
                  </li>
                ))}
              </ul>
            </section>
          ))}
          <p className="hint">Laid over the values that have matter, or over those of the selected points. Opacities stay.</p>
        </div>
      </Popover.Dropdown>
    </Popover>
  );
}
