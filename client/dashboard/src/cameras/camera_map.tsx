// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { useCallback, useRef } from 'preact/hooks';
import { Canvas } from '../shell/canvas';
import type { RigModel } from '../view/rig_model';
import { type CameraNeed, needsText } from './camera_needs';
import { drawMap } from './draw_map';
import { cameraAt, layoutMap, type MapLayout } from './map_layout';

/** A finger is so wide, pixels. */
const reach = 22;

/** All cameras of a large rig in one picture, seen from above. A tap names the nearest; the list beside it does the same with keys. */
export function CameraMap({ needs, found, model, chosen, theme, onChoose }: {
  needs: readonly CameraNeed[]; found: ReadonlySet<string>; model: RigModel; chosen: string; theme: string;
  onChoose: (name: string) => void;
}): JSX.Element {
  const layout = useRef<MapLayout>();
  const draw = useCallback((context: CanvasRenderingContext2D, width: number, height: number) => {
    const names = needs.map((need) => need.name).sort((a, b) => a.localeCompare(b, 'en', { numeric: true }));
    layout.current = layoutMap(names, model.cameras, width, height);
    drawMap(context, width, height, layout.current, needs, found, chosen);
  }, [needs, found, model.cameras, chosen, theme]);
  return <div class="cameramap" onClick={(event) => {
    const box = event.currentTarget.getBoundingClientRect();
    const name = layout.current && cameraAt(layout.current, [event.clientX - box.left, event.clientY - box.top], reach);
    onChoose(name ?? '');
  }}>
    <Canvas draw={draw} label={`Map of ${needs.length} cameras from above: ${needsText(needs)}`} />
  </div>;
}
