/** The views of a film, in their order: the view on screen is added, others are moved, timed, removed, gone back to. */

import { Button } from "@mantine/core";
import { IconButton, NumberField } from "../app/controls";
import { session } from "../session/engine";
import { changeViews, keepView } from "./savedViews";
import { FILM_LIMITS, movedView, withoutView, withSeconds, type SavedView } from "./film";
import { pictureSize, WayPicture } from "./WayPicture";

export function FilmViews({ views, sessionId, shape, goTo }: {
  views: readonly SavedView[];
  sessionId: string;
  /** Of the pictures. */
  shape: { width: number; height: number };
  /** Called when the person goes to one of the views. */
  goTo: () => void;
}) {
  const size = pictureSize(shape);
  return (
    <>
      <ol className="film-views" data-testid="film-views">
        {views.map((view, index) => (
          <li key={view.id} data-testid={`film-view-${index + 1}`}>
            <WayPicture sessionId={sessionId} camera={view.camera} {...size} />
            <span className="film-number number">{index + 1}</span>
            {index === 0 ? <span className="dim">The beginning</span> : (
              <span className="film-time">
                <NumberField label={`Seconds to view ${index + 1}`} value={view.seconds} min={FILM_LIMITS.seconds.min} max={FILM_LIMITS.seconds.max} step={0.5} suffix=" s" testId={`film-seconds-${index + 1}`} onChange={(seconds) => void changeViews((all) => withSeconds(all, view.id, seconds))} />
                <span className="dim">from the view before</span>
              </span>
            )}
            <span className="film-buttons">
              <IconButton icon="eye" label={`Go to view ${index + 1}`} testId={`film-go-${index + 1}`} onClick={() => {
                session.moveCamera(view.camera);
                goTo();
              }} />
              <IconButton icon="chevronUp" label={`Move view ${index + 1} up`} disabled={index === 0} testId={`film-up-${index + 1}`} onClick={() => void changeViews((all) => movedView(all, view.id, -1))} />
              <IconButton icon="chevron" label={`Move view ${index + 1} down`} disabled={index === views.length - 1} testId={`film-down-${index + 1}`} onClick={() => void changeViews((all) => movedView(all, view.id, 1))} />
              <IconButton icon="trash" label={`Remove view ${index + 1}`} testId={`film-remove-${index + 1}`} onClick={() => void changeViews((all) => withoutView(all, view.id))} />
            </span>
          </li>
        ))}
      </ol>
      <Button variant="default" onClick={() => void keepView()} disabled={views.length >= FILM_LIMITS.views} data-testid="film-add">Add the view on screen</Button>
    </>
  );
}
