// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';

/** Draws with CSS pixels on a canvas of the given size. */
export type Draw = (context: CanvasRenderingContext2D, width: number, height: number) => void;

/** A canvas as large as its box. It is drawn anew when `draw` or its size changes. */
export function Canvas({ draw, label, name }: { draw: Draw; label: string; name?: string }): JSX.Element {
  const canvas = useRef<HTMLCanvasElement>(null);
  const latest = useRef(draw);
  latest.current = draw;
  const paint = useRef(() => {
    const element = canvas.current;
    const context = element?.getContext('2d');
    if (!element || !context || element.clientWidth === 0) return;
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = [element.clientWidth, element.clientHeight];
    const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (element.width !== w || element.height !== h) {
      element.width = w;
      element.height = h;
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    latest.current(context, width, height);
  });
  useEffect(() => paint.current(), [draw]);
  useEffect(() => {
    const observer = new ResizeObserver(() => paint.current());
    if (canvas.current) observer.observe(canvas.current);
    return () => observer.disconnect();
  }, []);
  return <canvas ref={canvas} class={name} role="img" aria-label={label} />;
}
