// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import { isHidden, onVisibility } from './visible';

/** Draws with CSS pixels on a canvas of the given size. */
export type Draw = (context: CanvasRenderingContext2D, width: number, height: number) => void;

/** Twice a second is enough for what is polled, and a dozen canvases stay cheap. */
const leastMs = 480;

/** Paints a canvas when something has changed, at most twice a second, and only while it can be seen. */
class Painter {
  private draw: Draw;
  private due = true;
  private seen = true;
  private paintedAt = -Infinity;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private readonly ends: (() => void)[];

  constructor(private readonly canvas: HTMLCanvasElement, draw: Draw) {
    this.draw = draw;
    const size = new ResizeObserver(() => this.paint());
    size.observe(canvas);
    const place = new IntersectionObserver((entries) => {
      this.seen = entries.at(-1)?.isIntersecting ?? true;
      this.wake();
    }, { rootMargin: '100px' });
    place.observe(canvas);
    this.ends = [() => size.disconnect(), () => place.disconnect(), onVisibility(() => this.wake())];
    this.paint();
  }

  show(draw: Draw): void {
    if (draw === this.draw) return;
    this.draw = draw;
    this.due = true;
    this.wake();
  }

  end(): void {
    clearTimeout(this.timer);
    for (const end of this.ends) end();
  }

  private wake(): void {
    clearTimeout(this.timer);
    if (!this.due || !this.seen || isHidden()) return;
    const wait = this.paintedAt + leastMs - performance.now();
    if (wait <= 0) this.paint();
    else this.timer = setTimeout(() => this.paint(), wait);
  }

  private paint(): void {
    const context = this.canvas.getContext('2d');
    if (!context || this.canvas.clientWidth === 0) return;
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
    // Setting the size clears it, even where it is the same.
    if (this.canvas.width !== w || this.canvas.height !== h) {
      this.canvas.width = w;
      this.canvas.height = h;
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    this.draw(context, width, height);
    this.due = false;
    this.paintedAt = performance.now();
  }
}

/** A canvas as large as its box. It is drawn anew when `draw` or its size changes. */
export function Canvas({ draw, label, name }: { draw: Draw; label: string; name?: string }): JSX.Element {
  const canvas = useRef<HTMLCanvasElement>(null);
  const painter = useRef<Painter>();
  useEffect(() => {
    if (!canvas.current) return undefined;
    painter.current = new Painter(canvas.current, draw);
    return () => painter.current?.end();
  }, []);
  useEffect(() => painter.current?.show(draw), [draw]);
  return <canvas ref={canvas} class={name} role="img" aria-label={label} />;
}
