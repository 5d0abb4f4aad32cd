// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { useCallback, useEffect, useRef, useState } from 'preact/hooks';
import { Canvas } from '../shell/canvas';
import { changeSettings, readSettings } from '../shell/settings';
import { errorQuality, qualityRgb, rgbText, wantedMm } from '../view/colour_scale';
import { fixed, millimetres } from '../view/format';
import type { RigModel } from '../view/rig_model';
import { drawPlan } from './draw_plan';
import type { WebGlScene } from './webgl_scene';

interface Props {
  model: RigModel;
  goalMm: number | undefined;
  theme: string;
  label: string;
  /** What the accent colour stands for. */
  note: string;
}

function ThreeD({ model, goalMm, label, onFail, onSlow }: Omit<Props, 'note'> & {
  onFail: () => void; onSlow: ((ms: number) => void) | undefined;
}): JSX.Element {
  const box = useRef<HTMLDivElement>(null);
  const scene = useRef<WebGlScene>();
  const latest = useRef({ model, goalMm });
  latest.current = { model, goalMm };
  useEffect(() => {
    const element = box.current;
    if (!element) return undefined;
    let gone = false;
    // Each scene has a canvas of its own: a lost WebGL context does not come back on the old one.
    const canvas = document.createElement('canvas');
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', label);
    element.append(canvas);
    const observer = new ResizeObserver(() => scene.current?.resize(element.clientWidth, element.clientHeight));
    const begin = async (): Promise<void> => {
      try {
        const module = await import('./webgl_scene');
        if (gone) return;
        scene.current = new module.WebGlScene(canvas, onSlow);
        scene.current.resize(element.clientWidth, element.clientHeight);
        scene.current.show(latest.current.model, latest.current.goalMm);
        observer.observe(element);
      } catch {
        if (!gone) onFail();
      }
    };
    canvas.addEventListener('webglcontextlost', (event) => {
      event.preventDefault();
      if (!gone) onFail();
    });
    void begin();
    return () => {
      gone = true;
      observer.disconnect();
      scene.current?.dispose();
      scene.current = undefined;
      canvas.remove();
    };
  }, []);
  useEffect(() => scene.current?.show(model, goalMm), [model, goalMm]);
  return <>
    <div class="scene" ref={box} />
    <button type="button" class="quiet corner" onClick={() => scene.current?.reset(model)}>Show all</button>
  </>;
}

function Plan({ model, goalMm, theme, label }: Omit<Props, 'note'>): JSX.Element {
  const top = useCallback((context: CanvasRenderingContext2D, width: number, height: number) =>
    drawPlan(context, width, height, model, 'top', goalMm), [model, goalMm, theme]);
  const side = useCallback((context: CanvasRenderingContext2D, width: number, height: number) =>
    drawPlan(context, width, height, model, 'side', goalMm), [model, goalMm, theme]);
  return <div class="plans"><Canvas draw={top} label={`${label}, from above`} />
    <Canvas draw={side} label={`${label}, from the side`} /></div>;
}

/** Whether this browser has WebGL 2. */
function hasWebGl(): boolean {
  try {
    return document.createElement('canvas').getContext('webgl2') !== null;
  } catch {
    return false;
  }
}

let webGl: boolean | undefined;
/** A picture in 3-D took so long here, ms; asked for again by a person it is drawn nevertheless. */
let slow: number | undefined;
let insisted = false;

/** The rig in 3-D, or from above and from the side: where there is no WebGL, or by choice. */
export function SceneView({ model, goalMm, theme, label, note }: Props): JSX.Element {
  webGl ??= hasWebGl();
  const [usable, setUsable] = useState(webGl);
  const [choice, setChoice] = useState(readSettings().scene);
  const fail = useCallback(() => {
    webGl = false;
    setUsable(false);
  }, []);
  const [slowMs, setSlowMs] = useState(slow);
  const fallBack = useCallback((ms: number) => {
    slow = ms;
    setSlowMs(ms);
  }, []);
  const choose = (scene: '3d' | 'plan') => {
    if (scene === '3d' && slow !== undefined) insisted = true;
    setSlowMs(insisted ? undefined : slow);
    setChoice(changeSettings({ scene }).scene);
  };
  const shown = usable && (slowMs === undefined || insisted) ? choice : 'plan';
  const wanted = wantedMm(goalMm);
  return <div class="sceneview">
    <div class="toggle" role="group" aria-label="View">
      <button type="button" aria-pressed={shown === '3d'} disabled={!usable} onClick={() => choose('3d')}>3-D</button>
      <button type="button" aria-pressed={shown === 'plan'} onClick={() => choose('plan')}>Top and side</button>
      {!usable ? <span class="hint">This browser has no WebGL.</span>
        : slowMs !== undefined && !insisted && <span class="hint" role="status">3-D is slow here: {fixed(slowMs / 1000, 1)} s a picture.</span>}
    </div>
    <div class="stage">
      {model.cameras.length === 0 ? <p class="empty">Drawn once there is a first solution.</p>
        : shown === '3d' ? <ThreeD key={theme} model={model} goalMm={goalMm} theme={theme} label={label} onFail={fail}
          onSlow={insisted ? undefined : fallBack} />
          : <Plan model={model} goalMm={goalMm} theme={theme} label={label} />}
    </div>
    {model.places.length > 0 && <ErrorLegend wanted={wanted} note={[note, shown === '3d' ? 'grid: 0.5 m' : ''].filter(Boolean).join(' · ')} />}
  </div>;
}

function ErrorLegend({ wanted, note }: { wanted: number; note: string }): JSX.Element {
  const values = [4, 2, 1, 0.5].map((factor) => wanted * factor);
  return <p class="legend scenelegend">
    {values.map((value, i) => <span key={i}><Swatch quality={errorQuality(value, wanted)} size={1 - 0.17 * i} />{millimetres(value)}</span>)}
    <span>mm</span><span class="end">{note}</span></p>;
}

/** A square of the scale; larger is worse, as in the view. */
function Swatch({ quality, size }: { quality: number; size: number }): JSX.Element {
  const side = 12 * size;
  return <svg width="14" height="14" viewBox="0 0 14 14" aria-hidden="true">
    <rect x={7 - side / 2} y={7 - side / 2} width={side} height={side} fill={rgbText(qualityRgb(quality))} /></svg>;
}
