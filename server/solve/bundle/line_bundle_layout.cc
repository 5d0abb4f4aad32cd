// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/line_bundle_layout.h"

#include <array>
#include <map>
#include <utility>

#include "server/solve/bundle/camera_order.h"

namespace rigcal::server {
namespace {

bool IsFreeIntrinsic(const BundleCamera& camera, int i) {
  return !camera.intrinsics_fixed && camera.intrinsics_sigma[i] > 0;
}

int Append(const ReducedParameter& parameter, LineBundleLayout* layout) {
  layout->parameters.push_back(parameter);
  return layout->column_count() - 1;
}

// Columns of a clock's offset and rate, -1 where fixed.
std::pair<int, int> AppendClock(const BundleClock& clock, int index, LineBundleLayout* layout) {
  std::pair<int, int> columns(-1, -1);
  if (!clock.offset_fixed) {
    columns.first = Append({ReducedParameterKind::kTimeOffset, index, 0}, layout);
    if (clock.offset_sigma_s > 0) {
      layout->priors.push_back({columns.first, -1, clock.prior_offset_s, 1 / clock.offset_sigma_s});
    }
  }
  if (!clock.rate_fixed) {
    columns.second = Append({ReducedParameterKind::kTimeRate, index, 0}, layout);
    if (clock.rate_sigma > 0) {
      layout->priors.push_back({columns.second, -1, clock.prior_rate, 1 / clock.rate_sigma});
    }
  }
  return columns;
}

void AddBase(int kind, int column, KernelColumns* columns) {
  if (column < 0) return;
  columns->base_kind[columns->base_count] = kind;
  columns->base_column[columns->base_count] = column;
  ++columns->base_count;
}

struct CameraColumns {
  int pose = -1;
  int line_delay = -1;
  std::array<int, kMaxIntrinsics> intrinsics;
};

CameraColumns AppendCamera(const BundleCamera& camera, int index, LineBundleLayout* layout) {
  CameraColumns columns;
  columns.intrinsics.fill(-1);
  if (!camera.pose_fixed) {
    columns.pose = layout->column_count();
    for (int i = 0; i < 3; ++i) Append({ReducedParameterKind::kRotation, index, i}, layout);
    for (int i = 0; i < 3; ++i) Append({ReducedParameterKind::kTranslation, index, i}, layout);
  }
  for (int i = 0; i < static_cast<int>(camera.intrinsics.size()); ++i) {
    if (!IsFreeIntrinsic(camera, i)) continue;
    const int column = Append({ReducedParameterKind::kIntrinsic, index, i}, layout);
    columns.intrinsics[static_cast<size_t>(i)] = column;
    layout->priors.push_back(
        {column, -1, camera.intrinsics_mean[i], 1 / camera.intrinsics_sigma[i]});
  }
  if (!camera.line_delay_fixed) {
    columns.line_delay = Append({ReducedParameterKind::kLineDelay, index, 0}, layout);
    if (camera.line_delay_sigma_s > 0) {
      layout->priors.push_back(
          {columns.line_delay, -1, camera.prior_line_delay_s, 1 / camera.line_delay_sigma_s});
    }
  }
  return columns;
}

void AppendTarget(const BundleTarget& target, LineBundleLayout* layout) {
  const int count = static_cast<int>(target.marker_positions_m.size());
  if (target.fixed || count < 2) return;
  layout->spacing_column = layout->column_count();
  for (int m = 1; m < count; ++m) {
    const int column = Append({ReducedParameterKind::kMarkerPosition, m, 0}, layout);
    const BundleWand wand = target.WandOf(m);
    if (m == wand.first) {
      layout->priors.push_back({column, -1, 0, 1 / kHeldMarkerSigmaM});
      continue;
    }
    const auto at = static_cast<size_t>(m);
    double mean = target.given_positions_m[at] - target.given_positions_m[at - 1];
    if (m == 1) mean += target.marker_positions_m[0];
    layout->priors.push_back({column, m == 1 ? -1 : column - 1, mean, 1 / wand.span_sigma_m});
  }
}

}  // namespace

LineBundleLayout LayOut(const BundleProblem& problem) {
  LineBundleLayout layout;
  const size_t clock_count = problem.clocks.size();
  layout.clock_count = static_cast<int>(clock_count);
  layout.view_index.assign(problem.cameras.size() * clock_count, -1);
  for (const BundleInstant& instant : problem.instants) {
    ForEachUsedMarker(problem, instant,
                      [&layout](const BundleObservation& observation, const BundleMarker&) {
                        layout.ViewIndex(observation.camera, observation.clock) = 0;
                      });
  }
  const CameraOrder order = OrderCameras(problem);
  std::vector<int> cameras_of_clock(clock_count, 0);
  for (const int camera : order.cameras) {
    for (size_t clock = 0; clock < clock_count; ++clock) {
      int& index = layout.ViewIndex(camera, static_cast<int>(clock));
      if (index < 0) continue;
      index = static_cast<int>(layout.views.size());
      layout.views.push_back({camera, static_cast<int>(clock)});
      ++cameras_of_clock[clock];
    }
  }
  std::map<int, CameraColumns> cameras;
  std::map<int, std::pair<int, int>> clocks;
  const auto append_clock = [&](int clock) {
    if (clocks.contains(clock)) return;
    clocks[clock] = AppendClock(problem.clocks[static_cast<size_t>(clock)], clock, &layout);
  };
  std::vector<int> late;  // clocks that would tie cameras far apart to each other
  for (const LineBundleLayout::View& view : layout.views) {
    if (!cameras.contains(view.camera)) {
      const BundleCamera& camera = problem.cameras[static_cast<size_t>(view.camera)];
      cameras[view.camera] = AppendCamera(camera, view.camera, &layout);
    }
    if (order.is_sparse && cameras_of_clock[static_cast<size_t>(view.clock)] > 1) {
      late.push_back(view.clock);
    } else {
      append_clock(view.clock);
    }
  }
  for (const int clock : late) append_clock(clock);
  for (const LineBundleLayout::View& view : layout.views) {
    KernelColumns columns;
    columns.pose = cameras[view.camera].pose;
    AddBase(ViewUnknowns::kOffset, clocks[view.clock].first, &columns);
    AddBase(ViewUnknowns::kRate, clocks[view.clock].second, &columns);
    AddBase(ViewUnknowns::kLineDelay, cameras[view.camera].line_delay, &columns);
    for (int i = 0; i < kMaxIntrinsics; ++i) {
      const int column = cameras[view.camera].intrinsics[static_cast<size_t>(i)];
      columns.any_intrinsic = columns.any_intrinsic || column >= 0;
      AddBase(ViewUnknowns::kFirstIntrinsic + i, column, &columns);
    }
    layout.columns.push_back(columns);
  }
  AppendTarget(problem.target, &layout);
  if (problem.distance) {
    const BundleDistance& distance = *problem.distance;
    const auto pose = [&cameras](int camera) {
      const auto found = cameras.find(camera);
      return found == cameras.end() ? -1 : found->second.pose;
    };
    layout.distance = {distance.camera_a,       distance.camera_b,   pose(distance.camera_a),
                       pose(distance.camera_b), distance.distance_m, 1 / distance.sigma_m};
  }
  return layout;
}

}  // namespace rigcal::server
