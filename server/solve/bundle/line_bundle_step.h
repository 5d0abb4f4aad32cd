// SPDX-License-Identifier: Apache-2.0
#pragma once

// Elimination of the instants, and their step. Part of the line bundle's kernel; see
// line_bundle_kernel.h.
#include "server/solve/bundle/line_bundle_linearise.h"

namespace rigcal::server::RIGCAL_KERNEL {

// The Cholesky factor of a group's blocks as Factorise left it.
struct Factor {
  Lanes inverse[kInstantColumns], lower[10];

  RIGCAL_INLINE explicit Factor(const double* from) {
    for (int i = 0; i < kInstantColumns; ++i) inverse[i] = Load(from + i * kLanes);
    for (int i = 0; i < 10; ++i) lower[i] = Load(from + (5 + i) * kLanes);
  }
  RIGCAL_INLINE void SolveForward(Lanes (&x)[kInstantColumns]) const {
    for (int i = 0; i < kInstantColumns; ++i) {
      for (int j = 0; j < i; ++j) x[i] -= lower[i * (i - 1) / 2 + j] * x[j];
      x[i] *= inverse[i];
    }
  }
  RIGCAL_INLINE void SolveBackward(Lanes (&x)[kInstantColumns]) const {
    for (int i = kInstantColumns - 1; i >= 0; --i) {
      for (int j = i + 1; j < kInstantColumns; ++j) x[i] -= lower[j * (j - 1) / 2 + i] * x[j];
      x[i] *= inverse[i];
    }
  }
};

void Whiten(const KernelInput& input, const KernelBatch& batch, const double* factors,
            double* coupling) {
  for (int group = batch.first; group < batch.last; ++group) {
    const Factor factor(factors + group * kFactorLanes * kLanes);
    for (int tile = 0; tile < batch.tile_count; ++tile) {
      double* const block =
          coupling + static_cast<size_t>(tile * input.batch_groups + group - batch.first) *
                         (kTileSize * kInstantColumns * kLanes);
      Lanes whitened[kInstantColumns][kTileSize];
      for (int column = 0; column < kTileSize; ++column) {
        Lanes x[kInstantColumns];
        for (int r = 0; r < kInstantColumns; ++r) {
          x[r] = Load(block + (column * kInstantColumns + r) * kLanes);
        }
        factor.SolveForward(x);
        for (int r = 0; r < kInstantColumns; ++r) whitened[r][column] = x[r];
      }
      for (int r = 0; r < kInstantColumns; ++r) {
        TransposeSquare(whitened[r]);
        for (int lane = 0; lane < kLanes; ++lane) {
          Store(whitened[r][lane], block + (lane * kInstantColumns + r) * kTileSize);
        }
      }
    }
  }
}

// Rows of a tile whose sums stay in registers.
constexpr int kTileRows = kWidth;

RIGCAL_INLINE void SubtractProduct(const double* left, const double* right, uint64_t mask,
                                   double* tile) {
  for (int begin = 0; begin < kTileSize; begin += kTileRows) {
    Lanes sum[kTileRows];
    for (int row = 0; row < kTileRows; ++row) sum[row] = Load(tile + (begin + row) * kTileSize);
    for (uint64_t rest = mask; rest != 0; rest &= rest - 1) {
      const size_t at = static_cast<size_t>(__builtin_ctzll(rest)) * kInstantColumns * kTileSize;
      const double* a = left + at + begin;
      const double* b = right + at;
      // Keeps gcc from giving each of the forty addresses a register of its own.
      __asm__("" : "+r"(a), "+r"(b));
      for (int r = 0; r < kInstantColumns; ++r) {
        const Lanes factor = Load(b + r * kTileSize);
        for (int row = 0; row < kTileRows; ++row) {
          sum[row] -= Lanes(a[r * kTileSize + row]) * factor;
        }
      }
    }
    for (int row = 0; row < kTileRows; ++row) Store(sum[row], tile + (begin + row) * kTileSize);
  }
}

void Eliminate(const KernelInput& input, const KernelBatch& batch, const std::ptrdiff_t* rows,
               const double* coupling, double* tiles) {
  const size_t panel =
      static_cast<size_t>(input.batch_groups) * kLanes * kInstantColumns * kTileSize;
  for (int i = 0; i < batch.tile_count; ++i) {
    double* const row = tiles + rows[batch.tiles[i]] * kTileSize * kTileSize;
    for (int j = 0; j <= i; ++j) {
      const uint64_t mask = batch.masks[i] & batch.masks[j];
      if (mask == 0) continue;
      SubtractProduct(coupling + static_cast<size_t>(i) * panel,
                      coupling + static_cast<size_t>(j) * panel, mask,
                      row + batch.tiles[j] * kTileSize * kTileSize);
    }
  }
}

// The reduced step as one view feels it.
struct ViewStep {
  Vec3 rotation, translation;
  double base[kMaxBaseColumns];

  RIGCAL_INLINE ViewStep(const KernelColumns& columns, const double* step) {
    double pose[6] = {};
    for (int i = 0; i < columns.pose_count(); ++i) pose[i] = step[columns.pose + i];
    rotation = {Lanes(pose[0]), Lanes(pose[1]), Lanes(pose[2])};
    translation = {Lanes(pose[3]), Lanes(pose[4]), Lanes(pose[5])};
    for (int i = 0; i < columns.base_count; ++i) base[i] = step[columns.base_column[i]];
  }
};

// J_i^T w (r + J_reduced step): what the instant's own step has to answer.
template <bool kIntrinsics>
void SumAnswer(const KernelInput& input, const ViewEstimate<double>& view,
               const KernelColumns& columns, const KernelEntry& entry, const Line& line,
               const double* positions, const double* step, Vec3* n0, Vec3* n1) {
  CostSum ignored;
  const ViewStep view_step(columns, step);
  const double* slot = input.data + entry.data;
  const Lanes clock_time = Load(slot);
  const Lanes dt = TimeShift(view, clock_time);
  slot += kLanes;
  const Vec3 start_moves = view_step.translation + Cross(view_step.rotation, line.origin);
  const Vec3 slope_moves = Cross(view_step.rotation, line.slope);
  const Lanes zero(0.0);
  *n0 = *n1 = {zero, zero, zero};
  for (int m = 0; m < input.marker_count; ++m) {
    if ((entry.slots >> m & 1u) == 0) continue;
    const Lanes s(positions[m]);
    Projected projected;
    const MarkerResidual marker = EvaluateMarker<true, kIntrinsics>(
        input, view, slot, line.start + s * line.slope, dt, &projected, &ignored);
    Vec3 row0, row1;
    PointDerivative(marker.measured, projected, &row0, &row1);
    Vec3 moves = start_moves + s * slope_moves;
    if (input.spacing_column >= 0 && m > 0) {
      moves += Lanes(step[input.spacing_column + m - 1]) * line.slope;
    }
    Lanes e0 = marker.r0 + Dot(row0, moves), e1 = marker.r1 + Dot(row1, moves);
    for (int i = 0; i < columns.base_count; ++i) {
      Lanes d0, d1;
      ViewDerivative<kIntrinsics>(columns.base_kind[i], marker.measured, projected, clock_time,
                                  RowsLate(view, marker.measured.centre[1]), &d0, &d1);
      e0 += Lanes(view_step.base[i]) * d0;
      e1 += Lanes(view_step.base[i]) * d1;
    }
    const Vec3 n = (marker.weight * e0) * row0 + (marker.weight * e1) * row1;
    *n0 += n;
    *n1 += s * n;
    slot += kSlotLanes * kLanes;
  }
}

void SumCost(const KernelInput& input, const KernelEstimate& estimate, int group,
             const Vec3& origin, const Vec3& direction, CostSum* cost) {
  for (uint32_t e = input.first_entry[group]; e < input.first_entry[group + 1]; ++e) {
    const KernelEntry& entry = input.entries[e];
    const ViewEstimate<double>& view = estimate.views[entry.view];
    const Line line = SeeLine(view, origin, direction);
    const double* slot = input.data + entry.data;
    const Lanes dt = TimeShift(view, Load(slot));
    slot += kLanes;
    for (int m = 0; m < input.marker_count; ++m) {
      if ((entry.slots >> m & 1u) == 0) continue;
      Projected projected;
      EvaluateMarker<false, false>(input, view, slot,
                                   line.start + Lanes(estimate.positions[m]) * line.slope, dt,
                                   &projected, cost);
      slot += kSlotLanes * kLanes;
    }
  }
}

// The step of a group's instants, in their five columns.
void SolveInstants(const KernelInput& input, const KernelEstimate& estimate, int group,
                   const TargetPose& pose, const double* step, const double* factors,
                   Lanes (&x)[kInstantColumns]) {
  for (Lanes& value : x) value = Lanes(0.0);
  for (uint32_t e = input.first_entry[group]; e < input.first_entry[group + 1]; ++e) {
    const KernelEntry& entry = input.entries[e];
    const ViewEstimate<double>& view = estimate.views[entry.view];
    const KernelColumns& columns = input.columns[entry.view];
    const Line line = SeeLine(view, pose.origin, pose.direction);
    Vec3 n0, n1;
    if (columns.any_intrinsic) {
      SumAnswer<true>(input, view, columns, entry, line, estimate.positions, step, &n0, &n1);
    } else {
      SumAnswer<false>(input, view, columns, entry, line, estimate.positions, step, &n0, &n1);
    }
    const Vec3 origin = TransposedTimes(view.rotation, n0);
    const Vec3 direction = TransposedTimes(view.rotation, n1);
    x[0] -= origin.x, x[1] -= origin.y, x[2] -= origin.z;
    x[3] -= Dot(pose.tangent[0], direction), x[4] -= Dot(pose.tangent[1], direction);
  }
  const Factor factor(factors);
  factor.SolveForward(x);
  factor.SolveBackward(x);
}

void Step(const KernelInput& input, const KernelEstimate& estimate, double damping,
          const double* step, const double* factors, const KernelEstimate& moved,
          double* moved_poses, KernelStepResult* result) {
  CostSum cost;
  Lanes decrease(0.0), step_norm2(0.0), norm2(0.0);
  for (int group = 0; group < input.group_count; ++group) {
    input.Load(group);
    const TargetPose pose = LoadPose(estimate.poses + group * kPoseLanes * kLanes);
    const double* const factor = factors + group * kFactorLanes * kLanes;
    Lanes x[kInstantColumns];
    SolveInstants(input, estimate, group, pose, step, factor, x);
    for (int i = 0; i < kInstantColumns; ++i) {
      const Lanes diagonal = ClampedDiagonal(Load(factor + (15 + i) * kLanes));
      const Lanes gradient = Load(factor + (20 + i) * kLanes);
      decrease += x[i] * (Lanes(damping) * diagonal * x[i] - gradient);
      step_norm2 += x[i] * x[i];
    }
    norm2 += Dot(pose.origin, pose.origin);
    const Vec3 origin = pose.origin + Vec3{x[0], x[1], x[2]};
    const Vec3 bent = pose.direction + (x[3] * pose.tangent[0] + x[4] * pose.tangent[1]);
    const Vec3 direction = (Lanes(1.0) / Sqrt(Dot(bent, bent))) * bent;
    double* const to = moved_poses + group * kPoseLanes * kLanes;
    StoreVec3(origin, to);
    StoreVec3(direction, to + 3 * kLanes);
    SumCost(input, moved, group, origin, direction, &cost);
  }
  result->cost = cost.Cost(input);
  result->valid = cost.Valid();
  result->model_decrease = 0.5 * Sum(decrease);
  result->step_norm2 = Sum(step_norm2);
  result->norm2 = Sum(norm2);
}

void Evaluate(const KernelInput& input, const KernelEstimate& estimate, KernelStepResult* result) {
  CostSum cost;
  for (int group = 0; group < input.group_count; ++group) {
    input.Load(group);
    const double* const from = estimate.poses + group * kPoseLanes * kLanes;
    SumCost(input, estimate, group, LoadVec3(from), LoadVec3(from + 3 * kLanes), &cost);
  }
  result->cost = cost.Cost(input);
  result->valid = cost.Valid();
}

extern const LineBundleKernel kKernel;
const LineBundleKernel kKernel = {RIGCAL_KERNEL_NAME, Linearise, Whiten, Eliminate, Step, Evaluate};

}  // namespace rigcal::server::RIGCAL_KERNEL
