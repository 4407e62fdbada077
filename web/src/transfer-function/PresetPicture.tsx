/**
 * What a preset makes of the volume, drawn small by the service; a quiet square until it is there.
 *
 * Pictures are asked for one at a time, while the list of presets is open only, and drawn behind
 * what viewers move. They show the view the session began with, so that turning the volume draws
 * none of them anew.
 */

import { useEffect, useState } from "react";
import type { Patch } from "../scene/mergePatch";
import { askPreview, previewSize } from "../session/previews";
import { useSession } from "../session/store";
import { MAX_PICTURES, PictureCache, pictureKey } from "./pictures";

/** Size on the page, CSS pixels. */
const WIDTH = 112;
const HEIGHT = 84;
const pictures = new PictureCache(MAX_PICTURES, (address) => URL.revokeObjectURL(address));

export function PresetPicture({ patch }: { patch: Patch }) {
  const sessionId = useSession((state) => state.sessionId);
  const scene = useSession((state) => state.scene);
  const camera = useSession((state) => state.startCamera);
  // The service draws the scene it has: every edit has to be there first.
  const settled = useSession((state) => state.settled && state.link === "open");
  const whole = camera ? { ...patch, camera } : patch;
  const key = scene && pictureKey(scene, whole);
  const [drawn, setDrawn] = useState<{ key: string; address: string | null } | null>(null);
  const address = key === null ? null : drawn?.key === key ? drawn.address : pictures.get(key);
  const missing = drawn !== null && drawn.key === key && drawn.address === null;
  const wanted = key !== null && address === null && !missing && settled;

  useEffect(() => {
    if (!wanted || sessionId === null) return;
    // Patches are made anew with every rendering; the key holds this one's text.
    const [, request] = JSON.parse(key) as [unknown, Record<string, unknown>];
    return askPreview(sessionId, { patch: request, ...previewSize(WIDTH, HEIGHT) }, (blob, stopped) => {
      const made = URL.createObjectURL(blob);
      pictures.keep(key, made);
      if (!stopped) setDrawn({ key, address: made });
    }, () => setDrawn({ key, address: null })); // The curve beside it still says what the preset does.
  }, [wanted, key, sessionId]);

  return (
    <span className="preset-picture" data-state={address !== null ? "drawn" : missing ? "missing" : "waiting"}>
      {address !== null && <img src={address} width={WIDTH} height={HEIGHT} alt="" />}
    </span>
  );
}
