/**
 * The server's picture of a dataset; a quiet square until it is there.
 *
 * Pictures are drawn when they are first asked for, which can take seconds, and a browser opens few
 * connections to one host (six with HTTP/1.1). Only some of them are for thumbnails, so that a
 * histogram or an upload never waits behind a list of pictures.
 */

import { useEffect, useRef, useState } from "react";
import { thumbnailUrl } from "../api/rest";
import { Turns } from "./turns";

/** Thumbnails that are asked for at a time. */
const MAX_AT_A_TIME = 2;
const turns = new Turns(MAX_AT_A_TIME);

export function Thumbnail({ id }: { id: string }) {
  const [state, setState] = useState<"waiting" | "loading" | "missing">("waiting");
  const place = useRef<HTMLSpanElement>(null);
  const release = useRef<() => void>(() => undefined);

  useEffect(() => {
    const element = place.current;
    if (!element) return;
    // Cards that are never scrolled into view cost nothing.
    const observer = new IntersectionObserver((entries) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      observer.disconnect();
      release.current = turns.ask(() => setState("loading"));
    });
    observer.observe(element);
    return () => {
      observer.disconnect();
      release.current();
    };
  }, []);

  const ended = (missing: boolean) => {
    release.current();
    if (missing) setState("missing");
  };
  return (
    <span className="thumbnail" ref={place}>
      {state === "loading" && <img src={thumbnailUrl(id)} alt="" onLoad={() => ended(false)} onError={() => ended(true)} />}
    </span>
  );
}
