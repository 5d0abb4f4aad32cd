// SPDX-License-Identifier: Apache-2.0
// What a camera sees, as small pictures that renew themselves while they are on the screen.
import type { JSX, RefObject } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { ApiError, getPreview } from '../api/server_api';
import { PreviewQueue } from './preview_queue';

const queue = new PreviewQueue();
/** Refusals that last: the camera gives none as things are, or not to this person. */
const lasting = ['FAILED_PRECONDITION', 'PERMISSION_DENIED', 'UNAUTHENTICATED'];

/** Shows the previews of a camera in an image; what is wrong with them, '' once there is one. A camera that gives none
 * is asked again when `state` changes: its session, its agent. */
export function usePreview(image: RefObject<HTMLImageElement>, rig: string, camera: string, state: string): string {
  const [problem, setProblem] = useState('waiting for a first image');
  useEffect(() => {
    const element = image.current;
    if (!element) return undefined;
    const key = `${rig}/${camera}`;
    const abort = new AbortController();
    let shown = '';
    const load = async (): Promise<'none' | void> => {
      if (document.visibilityState === 'hidden') return undefined;
      try {
        const blob = await getPreview(rig, camera, abort.signal);
        if (abort.signal.aborted) return undefined;
        const before = shown;
        shown = URL.createObjectURL(blob);
        element.src = shown;
        await element.decode();
        if (before) URL.revokeObjectURL(before);
        setProblem('');
      } catch (error) {
        if (abort.signal.aborted) return undefined;
        setProblem(error instanceof ApiError ? error.message : 'the preview is no image');
        if (error instanceof ApiError && lasting.includes(error.code)) return 'none';
      }
      return undefined;
    };
    const observer = new IntersectionObserver(([entry]) => {
      if (entry?.isIntersecting) queue.add(key, load);
      else queue.remove(key);
    });
    observer.observe(element);
    return () => {
      abort.abort();
      observer.disconnect();
      queue.remove(key);
      element.removeAttribute('src');
      if (shown) URL.revokeObjectURL(shown);
    };
  }, [rig, camera]);
  useEffect(() => queue.wake(`${rig}/${camera}`), [rig, camera, state]);
  return problem;
}

/** A preview with its problem in words. */
export function Preview({ rig, camera, state }: { rig: string; camera: string; state: string }): JSX.Element {
  const image = useRef<HTMLImageElement>(null);
  const problem = usePreview(image, rig, camera, state);
  return <div class="preview">
    <img ref={image} alt={`What ${camera} sees`} class={problem === '' ? '' : 'none'} />
    {problem !== '' && <p>{problem}</p>}
  </div>;
}

/** What a camera sees; nothing while it has no picture. `onShown` says which of both. */
export function PreviewImage({ image, rig, camera, state, onShown }: {
  image: { current: HTMLImageElement | null }; rig: string; camera: string; state: string; onShown: (shown: boolean) => void;
}): JSX.Element {
  const problem = usePreview(image, rig, camera, state);
  useEffect(() => {
    onShown(problem === '');
    return () => onShown(false);
  }, [problem === '']);
  return <img ref={image} alt={`What ${camera} sees`} class={problem === '' ? '' : 'none'} />;
}
