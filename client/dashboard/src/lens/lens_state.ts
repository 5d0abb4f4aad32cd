// SPDX-License-Identifier: Apache-2.0
// How far the lens of a camera is, in words.
import { toCount } from '../api/json_values';
import type { Lens, Session } from '../api/types';
import type { Mark } from '../shell/parts';

/** More was recorded than the lens has been made from. */
export function isBehind(lens: Lens): boolean {
  return toCount(lens.result?.observation_count) < toCount(lens.stored_count);
}

/** Symbol and words of a lens. */
export function lensState(lens: Lens | undefined): readonly [Mark, string] {
  const views = lens?.views?.length ?? 0;
  if (!lens || !lens.state || lens.state === 'STATE_READING') return ['idle', 'reading what was recorded'];
  if (lens.state === 'STATE_COLLECTING') return ['warn', views === 1 ? '1 view, more are needed' : `${views} views, more are needed`];
  if (lens.state === 'STATE_SOLVING') return ['live', `the lens is being made from ${views} views`];
  if (lens.state === 'STATE_FAILED') return ['bad', 'no lens'];
  const again = isBehind(lens) ? ', made again with what is new' : '';
  return lens.result?.advice?.length ? ['warn', `a lens that can be better${again}`] : ['good', `a good lens${again}`];
}

/** The session was recorded with a board and is there to be looked at. */
export function isBoardSession(session: Session | undefined): boolean {
  return Boolean(session?.id && session.target?.board && !session.discard_time);
}

/** The session whose lenses are shown: the one asked for, else the rig's, else the newest one with a board; '': none. */
export function chooseSession(asked: string, current: Session | undefined, all: readonly Session[]): string {
  if (asked !== '') return asked;
  if (isBoardSession(current)) return current?.id ?? '';
  return all.find(isBoardSession)?.id ?? '';
}

/** The cameras of a session by name, and whether each had a lens when it was recorded. */
export function lensCameras(session: Session | undefined): { name: string; hasLens: boolean }[] {
  return (session?.cameras ?? []).map((camera) => ({ name: camera.description?.camera ?? '',
    hasLens: camera.description?.intrinsics !== undefined }));
}

/** The camera that is shown: the one asked for, else the first without a lens. */
export function chooseCamera(asked: string, cameras: readonly { name: string; hasLens: boolean }[]): string {
  if (cameras.some((camera) => camera.name === asked)) return asked;
  return (cameras.find((camera) => !camera.hasLens) ?? cameras[0])?.name ?? '';
}
