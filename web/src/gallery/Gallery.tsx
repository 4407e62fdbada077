/** All sessions of the service: watch one, or take a copy of its scene; join and end those that this browser may edit. */

import { Button, Modal } from "@mantine/core";
import { useEffect, useMemo, useState } from "react";
import { deleteSession, getSessions } from "../api/rest";
import { copyWatchLink } from "../app/files";
import { sayError } from "../app/say";
import { useUi } from "../app/uiStore";
import { useDatasets } from "../datasets/store";
import type { Session } from "../generated/proto";
import { session as own } from "../session/engine";
import { editableId, listedId } from "../session/ownSessions";
import { sessionAddress } from "../session/shareLink";
import { useSession } from "../session/store";
import { datasetOf } from "../session/volumeFacts";
import { wordsOf } from "../session/words";
import { SessionPicture } from "./SessionPicture";
import { agoInWords, contentOf, inOrder, viewersInWords } from "./sessions";

/** While it is open the list is asked for again after this time, milliseconds. */
const REFRESH_MILLIS = 5000;

const close = (): void => void useUi.setState({ galleryOpen: false });

export function Gallery() {
  const opened = useUi((ui) => ui.galleryOpen);
  return (
    <Modal opened={opened} onClose={close} title="Sessions on this server" size={940} closeButtonProps={{ "aria-label": "Close" }} data-testid="gallery">
      <Sessions />
    </Modal>
  );
}

function Sessions() {
  const [list, setList] = useState<{ sessions: Session[]; at: number } | null>(null);
  const [failure, setFailure] = useState<string | null>(null);
  const [asked, setAsked] = useState(0);
  const sessionId = useSession((state) => state.sessionId);
  const mine = useMemo(() => (sessionId === null ? null : listedId(sessionId)), [sessionId]);

  useEffect(() => {
    let over = false;
    const ask = () => {
      if (document.hidden) return;
      getSessions().then(
        (sessions) => {
          if (over) return;
          setList({ sessions, at: Date.now() });
          setFailure(null);
        },
        (error: unknown) => over || setFailure(wordsOf(error)),
      );
    };
    ask();
    const timer = window.setInterval(ask, REFRESH_MILLIS);
    return () => {
      over = true;
      window.clearInterval(timer);
    };
  }, [asked]);

  if (failure !== null) return <p className="note note-danger" role="alert">{failure}</p>;
  if (!list) return <p className="hint">Asking the service …</p>;
  return (
    <>
      <p className="hint">You may join the sessions that you opened or were given a link to, and watch the others. Edits in a session reach everybody in it; each has a view of their own. A session is kept when nobody looks, also over a restart of the server.</p>
      <ul className="gallery" data-testid="gallery-list">
        {inOrder(list.sessions, mine).map((session) => <Tile key={session.id} session={session} mine={session.id === mine} now={list.at} onEnded={() => setAsked((n) => n + 1)} />)}
      </ul>
    </>
  );
}

function Tile({ session, mine, now, onEnded }: { session: Session; mine: boolean; now: number; onEnded: () => void }) {
  const datasets = useDatasets((state) => state.list);
  const [confirming, setConfirming] = useState(false);
  const { name, drawn } = contentOf(session, datasets);
  const editable = editableId(session.id);
  const enter = () => {
    window.location.hash = sessionAddress(editable ?? session.id);
    close();
  };
  const copy = () => void own.openScene(session.scene).then(close, sayError);
  return (
    <li className="gallery-tile" data-mine={mine} data-testid={`session-${session.id}`}>
      <SessionPicture id={session.id} epoch={session.epoch} dataset={datasetOf(session.scene.volume)} />
      <strong className="gallery-name" title={name}>{name}</strong>
      <span className="dim">{drawn} · used {agoInWords(session.used_unix_millis, now)}</span>
      <span className="dim">{viewersInWords(session.viewers, mine)}</span>
      {confirming ? (
        <div className="tile-actions" role="alertdialog" aria-label={`End the session of ${name}?`}>
          <Button color="red" variant="light" size="compact-xs" onClick={() => void deleteSession(editable ?? session.id).then(onEnded, sayError)} data-testid="session-end-confirm">End for everybody</Button>
          <Button variant="default" size="compact-xs" onClick={() => setConfirming(false)}>Keep</Button>
        </div>
      ) : (
        <div className="tile-actions">
          {mine && <span className="gallery-here">This page</span>}
          {!mine && editable !== null && <Button variant="default" size="compact-xs" title="Work in it together" onClick={enter} data-testid="session-join">Join</Button>}
          {!mine && editable === null && <Button variant="default" size="compact-xs" title="See every edit in a view of your own; to edit, ask for a link or take a copy" onClick={enter} data-testid="session-look">Watch</Button>}
          <Button variant="default" size="compact-xs" title="A session of your own with this scene" onClick={copy} data-testid="session-copy">Copy</Button>
          <button type="button" className="text-button" title="Copy a link under which it is looked at and not edited" onClick={() => void copyWatchLink(session.id).catch(sayError)} data-testid="session-watch">Watch link</button>
          {!mine && editable !== null && <button type="button" className="text-button" onClick={() => setConfirming(true)} data-testid="session-end">End</button>}
        </div>
      )}
    </li>
  );
}
