/** What a session shows, drawn small by the service from the session's camera. */

import { useEffect, useState } from "react";
import { Thumbnail } from "../datasets/Thumbnail";
import { askPreview, previewSize } from "../session/previews";
import { MAX_PICTURES, PictureCache } from "../transfer-function/pictures";

/** Size on the page, CSS pixels. */
const WIDTH = 208;
const HEIGHT = 132;

const pictures = new PictureCache(MAX_PICTURES, (address) => URL.revokeObjectURL(address));

export function SessionPicture({ id, epoch, dataset }: {
  id: string;
  epoch: number;
  /** Its picture stands in until that of the session is there. */
  dataset: string | null;
}) {
  const key = `${id} ${epoch}`;
  const [drawn, setDrawn] = useState<{ key: string; address: string } | null>(null);
  // The picture before stays while another viewer edits.
  const address = pictures.get(key) ?? drawn?.address ?? null;

  useEffect(() => {
    if (pictures.get(key) !== null) return;
    return askPreview(id, { patch: {}, ...previewSize(WIDTH, HEIGHT) }, (blob, stopped) => {
      const made = URL.createObjectURL(blob);
      pictures.keep(key, made);
      if (!stopped) setDrawn({ key, address: made });
    }, () => undefined); // The name beside it still says what it is.
  }, [id, key]);

  return (
    <span className="gallery-picture" data-drawn={address !== null}>
      {address !== null ? <img src={address} width={WIDTH} height={HEIGHT} alt="" /> : dataset !== null && <Thumbnail id={dataset} />}
    </span>
  );
}
