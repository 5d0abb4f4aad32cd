// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import type { LiveFigure } from '../api/types';
import { palette } from '../shell/palette';
import { millimetres, span } from '../view/format';

type Data = [number[], (number | null)[], (number | null)[]];

function dataOf(history: readonly LiveFigure[], goalMm: number | undefined): Data {
  const points = history.filter((point) => (point.p95_mm ?? 0) > 0);
  return [points.map((point) => point.time_s ?? 0), points.map((point) => point.p95_mm ?? null),
    points.map(() => goalMm ?? null)];
}

/** Minutes and seconds: 1:40. */
function clock(seconds: number): string {
  return seconds < 60 ? `${Math.round(seconds)} s` : `${Math.floor(seconds / 60)}:${String(Math.round(seconds % 60)).padStart(2, '0')}`;
}

/** Range of a logarithmic axis around values, in half steps of 1 2 5. */
export function figureRange(min: number | null, max: number | null, goalMm: number | undefined): [number, number] {
  const values = [min, max, goalMm].filter((value): value is number => typeof value === 'number' && value > 0);
  if (values.length === 0) return [0.1, 10];
  const steps = [1, 2, 5];
  const below = (value: number) => {
    const decade = 10 ** Math.floor(Math.log10(value));
    return decade * Math.max(...steps.filter((step) => step * decade <= value * 1.0001), 1);
  };
  const above = (value: number) => {
    const decade = 10 ** Math.floor(Math.log10(value));
    return decade * ([...steps, 10].find((step) => step * decade >= value * 0.9999) ?? 10);
  };
  return [below(Math.min(...values) * 0.9), above(Math.max(...values) * 1.1)];
}

/** The figure over time, on a logarithmic axis, with the goal. */
export function FigureCurve({ history, goalMm, theme }: {
  history: readonly LiveFigure[]; goalMm: number | undefined; theme: string;
}): JSX.Element {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot>();
  const goal = useRef(goalMm);
  goal.current = goalMm;
  useEffect(() => {
    const element = box.current;
    if (!element) return undefined;
    const colours = palette();
    const axis = { stroke: colours.faint, grid: { stroke: colours.line, width: 1 }, ticks: { show: false },
      font: '11px system-ui, sans-serif' };
    const chart = new uPlot({
      width: Math.max(120, element.clientWidth), height: Math.max(80, element.clientHeight),
      legend: { show: false }, cursor: { show: false },
      scales: { x: { time: false }, y: { distr: 3, range: (_, min, max) => figureRange(min, max, goal.current) } },
      axes: [{ ...axis, size: 24, values: (_, values) => values.map(clock) },
        { ...axis, size: 40, filter: (_, splits) => splits, values: (_, values) => values.map((value) => {
          const digit = value / 10 ** Math.floor(Math.log10(value) + 1e-9);
          return [1, 2, 5].some((step) => Math.abs(digit - step) < 0.01) ? millimetres(value).replace(/\.?0+$/, '') : '';
        }) }],
      series: [{}, { stroke: colours.accent, width: 2,
        // A line of one point cannot be seen.
        points: { show: (chart: uPlot) => chart.data[0].length < 3, size: 7, fill: colours.accent } },
        { stroke: colours.ink, width: 1.2, dash: [5, 4], points: { show: false } }],
    }, dataOf(history, goalMm), element);
    plot.current = chart;
    const observer = new ResizeObserver(() => {
      if (element.clientWidth > 0) chart.setSize({ width: element.clientWidth, height: element.clientHeight });
    });
    observer.observe(element);
    return () => {
      observer.disconnect();
      chart.destroy();
      plot.current = undefined;
    };
  }, [theme]);
  useEffect(() => plot.current?.setData(dataOf(history, goalMm)), [history, goalMm]);
  const last = history.at(-1);
  return <div class="curve" ref={box} role="img" aria-label={last
    ? `The expected error over time; now ${millimetres(last.p95_mm)} mm after ${span(last.time_s)}`
    : 'The expected error over time; nothing yet'} />;
}
