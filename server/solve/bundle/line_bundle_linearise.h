// SPDX-License-Identifier: Apache-2.0
#pragma once

// Normal equations of eight instants at a time. Part of the line bundle's kernel; see
// line_bundle_kernel.h.
#include "server/solve/bundle/line_bundle_marker.h"

namespace rigcal::server::RIGCAL_KERNEL {

// Every derivative goes through the point in the camera's frame, p = R o + t + s R d, which is
// linear in s. With A_m the whitened derivative by the point and w_m the weight of marker m, the
// three symmetric sums M_i = sum w_m s_m^i A_m^T A_m give all blocks between pose, origin and
// direction; any further column with derivative e_m needs N_i = sum w_m s_m^i A_m^T e_m, i = 0, 1.
struct Sym3 {
  Lanes xx, xy, xz, yy, yz, zz;

  RIGCAL_INLINE Vec3 Column(int i) const {
    return i == 0 ? Vec3{xx, xy, xz} : i == 1 ? Vec3{xy, yy, yz} : Vec3{xz, yz, zz};
  }
};
RIGCAL_INLINE void AddScaled(const Lanes& s, const Sym3& m, Sym3* to) {
  to->xx += s * m.xx, to->xy += s * m.xy, to->xz += s * m.xz;
  to->yy += s * m.yy, to->yz += s * m.yz, to->zz += s * m.zz;
}

constexpr int kMaxExtras = kMaxBaseColumns + 1 + kMaxLineMarkers - 1;

// Base columns, gradient, then spacing: what is not the pose.
struct EntrySums {
  Sym3 m0, m1, m2;
  int count;
  Vec3 n0[kMaxExtras], n1[kMaxExtras];
  Lanes inner[kMaxExtras * (kMaxExtras + 1) / 2];  // of extras with each other, lower triangle

  RIGCAL_INLINE void Clear(int extras) {
    const Lanes zero(0.0);
    m0 = m1 = m2 = {zero, zero, zero, zero, zero, zero};
    count = extras;
    for (int i = 0; i < extras; ++i) n0[i] = n1[i] = {zero, zero, zero};
    for (int i = 0; i < extras * (extras + 1) / 2; ++i) inner[i] = zero;
  }
  RIGCAL_INLINE Lanes& Inner(int i, int j) { return inner[i * (i + 1) / 2 + j]; }
};

template <bool kIntrinsics>
void SumMarkers(const KernelInput& input, const ViewEstimate<double>& view,
                const KernelColumns& columns, const KernelEntry& entry, const Line& line,
                const double* positions, EntrySums* sums, CostSum* cost) {
  const double* slot = input.data + entry.data;
  const Lanes clock_time = Load(slot);
  const Lanes dt = TimeShift(view, clock_time);
  slot += kLanes;
  const int base = columns.base_count;
  for (int m = 0; m < input.marker_count; ++m) {
    if ((entry.slots >> m & 1u) == 0) continue;
    const Lanes s(positions[m]);
    Projected projected;
    const MarkerResidual marker = EvaluateMarker<true, kIntrinsics>(
        input, view, slot, line.start + s * line.slope, dt, &projected, cost);
    Vec3 row0, row1;
    PointDerivative(marker.measured, projected, &row0, &row1);
    const Vec3 weighted0 = marker.weight * row0, weighted1 = marker.weight * row1;
    const Sym3 point = {
        row0.x * weighted0.x + row1.x * weighted1.x, row0.x * weighted0.y + row1.x * weighted1.y,
        row0.x * weighted0.z + row1.x * weighted1.z, row0.y * weighted0.y + row1.y * weighted1.y,
        row0.y * weighted0.z + row1.y * weighted1.z, row0.z * weighted0.z + row1.z * weighted1.z};
    const Lanes s2 = s * s;
    AddScaled(Lanes(1.0), point, &sums->m0);
    AddScaled(s, point, &sums->m1);
    AddScaled(s2, point, &sums->m2);

    Lanes e0[kMaxBaseColumns + 2], e1[kMaxBaseColumns + 2];
    int index[kMaxBaseColumns + 2];
    int count = base + 1;
    for (int i = 0; i < base; ++i) {
      index[i] = i;
      ViewDerivative<kIntrinsics>(columns.base_kind[i], marker.measured, projected, clock_time,
                                  RowsLate(view, marker.measured.centre[1]), &e0[i], &e1[i]);
    }
    index[base] = base;
    e0[base] = marker.r0, e1[base] = marker.r1;
    if (input.spacing_column >= 0 && m > 0) {
      index[count] = base + m;
      e0[count] = Dot(row0, line.slope), e1[count] = Dot(row1, line.slope);
      ++count;
    }
    for (int i = 0; i < count; ++i) {
      const Vec3 n = e0[i] * weighted0 + e1[i] * weighted1;
      sums->n0[index[i]] += n;
      sums->n1[index[i]] += s * n;
      const Lanes w0 = marker.weight * e0[i], w1 = marker.weight * e1[i];
      for (int j = 0; j <= i; ++j) sums->Inner(index[i], index[j]) += w0 * e0[j] + w1 * e1[j];
    }
    slot += kSlotLanes * kLanes;
  }
}

// The derivative's product of one reduced column with the instant: five rows of the coupling.
struct CouplingWriter {
  const double* rotation;
  Vec3 tangent[2];  // in the camera's frame
  double* coupling;
  const int* places;
  int group_count, group;

  RIGCAL_INLINE double* At(int column) const {
    const size_t tile = static_cast<size_t>(places[column / kTileSize]);
    const size_t block =
        (tile * static_cast<size_t>(group_count) + static_cast<size_t>(group)) * kTileSize +
        static_cast<size_t>(column % kTileSize);
    return coupling + block * kInstantColumns * kLanes;
  }
  RIGCAL_INLINE void ZeroTile(int tile) const {
    double* const to = At(tile * kTileSize);
    for (int i = 0; i < kTileSize * kInstantColumns; ++i) Store(Lanes(0.0), to + i * kLanes);
  }
  RIGCAL_INLINE void Add(int column, const Vec3& n0, const Vec3& n1) const {
    const Vec3 origin = TransposedTimes(rotation, n0);
    Lanes rows[kInstantColumns] = {origin.x, origin.y, origin.z, Dot(tangent[0], n1),
                                   Dot(tangent[1], n1)};
    double* const to = At(column);
    for (int r = 0; r < kInstantColumns; ++r) {
      Store(Load(to + r * kLanes) + rows[r], to + r * kLanes);
    }
  }
};

RIGCAL_INLINE void AddTo(double* sums, int row, int column, const Lanes& value) {
  double* const at = sums + (row * (row + 1) / 2 + column) * kLanes;
  Store(Load(at) + value, at);
}
RIGCAL_INLINE const Lanes& Component(const Vec3& v, int i) {
  return i == 0 ? v.x : i == 1 ? v.y : v.z;
}

// V += the entry's part of the instant's own block (5x5, lower triangle by rows).
RIGCAL_INLINE void AddInstantBlock(const EntrySums& sums, const double* rotation,
                                   const Vec3 (&tangent)[2], Lanes (&v)[15]) {
  Vec3 rotated[3], bent[2];  // R^T M0 by columns; M1 tangent
  for (int i = 0; i < 3; ++i) rotated[i] = TransposedTimes(rotation, sums.m0.Column(i));
  for (int d = 0; d < 2; ++d) {
    bent[d] = TransposedTimes(
        rotation, Vec3{Dot(sums.m1.Column(0), tangent[d]), Dot(sums.m1.Column(1), tangent[d]),
                       Dot(sums.m1.Column(2), tangent[d])});
  }
  for (int i = 0, at = 0; i < 3; ++i) {
    for (int j = 0; j <= i; ++j, ++at) {
      v[at] += Component(rotated[0], i) * Lanes(rotation[j]) +
               Component(rotated[1], i) * Lanes(rotation[3 + j]) +
               Component(rotated[2], i) * Lanes(rotation[6 + j]);
    }
  }
  for (int d = 0, at = 6; d < 2; ++d) {
    for (int j = 0; j < 3; ++j, ++at) v[at] += Component(bent[d], j);
    const Vec3 m2 = {Dot(sums.m2.Column(0), tangent[d]), Dot(sums.m2.Column(1), tangent[d]),
                     Dot(sums.m2.Column(2), tangent[d])};
    for (int e = 0; e <= d; ++e, ++at) v[at] += Dot(m2, tangent[e]);
  }
}

// The view's own block, and the coupling of its columns to the instants.
void AddReducedBlocks(const KernelInput& input, const KernelColumns& columns, EntrySums* sums,
                      const Line& line, const CouplingWriter& writer, double* view_sums) {
  const int pose = columns.pose_count(), base = columns.base_count;
  if (pose > 0) {
    Vec3 rot0[3], rot1[3];  // N0 and N1 of the rotation: [p]x A^T A with p = R o + s R d
    {
      const Vec3 c0[3] = {sums->m0.Column(0), sums->m0.Column(1), sums->m0.Column(2)};
      const Vec3 c1[3] = {sums->m1.Column(0), sums->m1.Column(1), sums->m1.Column(2)};
      const Vec3 c2[3] = {sums->m2.Column(0), sums->m2.Column(1), sums->m2.Column(2)};
      Vec3 p0[3], p1[3];
      for (int i = 0; i < 3; ++i) {
        p0[i] = Cross(line.origin, c0[i]) + Cross(line.slope, c1[i]);
        p1[i] = Cross(line.origin, c1[i]) + Cross(line.slope, c2[i]);
      }
      for (int i = 0; i < 3; ++i) {
        rot0[i] = {Component(p0[0], i), Component(p0[1], i), Component(p0[2], i)};
        rot1[i] = {Component(p1[0], i), Component(p1[1], i), Component(p1[2], i)};
      }
    }
    for (int i = 0; i < 3; ++i) {
      const Vec3 both = Cross(line.origin, rot0[i]) + Cross(line.slope, rot1[i]);
      for (int j = 0; j <= i; ++j) {
        AddTo(view_sums, i, j, Component(both, j));
        AddTo(view_sums, 3 + i, 3 + j, Component(sums->m0.Column(i), j));
      }
      for (int j = 0; j < 3; ++j) AddTo(view_sums, 3 + j, i, Component(rot0[i], j));
      writer.Add(columns.pose + i, rot0[i], rot1[i]);
      writer.Add(columns.pose + 3 + i, sums->m0.Column(i), sums->m1.Column(i));
    }
  }
  for (int x = 0; x < sums->count; ++x) {
    const Vec3 &n0 = sums->n0[x], &n1 = sums->n1[x];
    if (pose > 0) {
      const Vec3 rotation = Cross(line.origin, n0) + Cross(line.slope, n1);
      for (int j = 0; j < 3; ++j) {
        AddTo(view_sums, pose + x, j, Component(rotation, j));
        AddTo(view_sums, pose + x, 3 + j, Component(n0, j));
      }
    }
    for (int y = 0; y <= x; ++y) AddTo(view_sums, pose + x, pose + y, sums->Inner(x, y));
    if (x < base) {
      writer.Add(columns.base_column[x], n0, n1);
    } else {
      const int column = x == base ? input.column_count : input.spacing_column + (x - base - 1);
      writer.Add(column, n0, n1);
    }
  }
}

RIGCAL_INLINE Lanes ClampedDiagonal(const Lanes& diagonal) {
  return Min(Max(diagonal, Lanes(kMinDiagonal)), Lanes(kMaxDiagonal));
}

// Cholesky of the damped block. A pivot that rounding alone can explain is a direction that nothing
// observes: it is held instead of being divided by.
void Factorise(const Lanes (&v)[15], double damping, const double* gradient, double* factors) {
  Lanes inverse[kInstantColumns], lower[10];
  for (int i = 0; i < kInstantColumns; ++i) {
    const Lanes diagonal = v[i * (i + 1) / 2 + i];
    const Lanes damped = diagonal + Lanes(damping) * ClampedDiagonal(diagonal);
    Lanes* const row = lower + i * (i - 1) / 2;
    Lanes pivot = damped;
    for (int j = 0; j < i; ++j) {
      Lanes sum = v[i * (i + 1) / 2 + j];
      for (int k = 0; k < j; ++k) sum -= row[k] * lower[j * (j - 1) / 2 + k];
      row[j] = sum * inverse[j];
      pivot -= row[j] * row[j];
    }
    const Mask good = pivot > damped * Lanes(1e-13);
    inverse[i] = Select(good, Lanes(1.0) / Sqrt(Select(good, pivot, Lanes(1.0))), Lanes(0.0));
    Store(inverse[i], factors + i * kLanes);
    Store(diagonal, factors + (15 + i) * kLanes);
    Store(Load(gradient + i * kLanes), factors + (20 + i) * kLanes);
  }
  for (int i = 0; i < 10; ++i) Store(lower[i], factors + (5 + i) * kLanes);
}

void Linearise(const KernelInput& input, const KernelBatch& batch, const KernelEstimate& estimate,
               double damping, double* factors, double* const* view_sums, double* coupling,
               KernelLinearisation* result) {
  CostSum cost;
  Lanes gradient_max(0.0);
  EntrySums sums;
  for (int group = batch.first; group < batch.last; ++group) {
    input.Load(group);
    const KernelEntry* const begin = input.entries + input.first_entry[group];
    const KernelEntry* const end = input.entries + input.first_entry[group + 1];
    const TargetPose pose = LoadPose(estimate.poses + group * kPoseLanes * kLanes);
    CouplingWriter writer{
        nullptr, {}, coupling, batch.places, input.batch_groups, group - batch.first};
    // Columns of the batch's tiles that no entry of the group sets stay so.
    for (int tile = 0; tile < batch.tile_count; ++tile) writer.ZeroTile(batch.tiles[tile]);
    Lanes v[15];
    for (Lanes& value : v) value = Lanes(0.0);
    for (const KernelEntry* entry = begin; entry != end; ++entry) {
      const ViewEstimate<double>& view = estimate.views[entry->view];
      const KernelColumns& columns = input.columns[entry->view];
      const Line line = SeeLine(view, pose.origin, pose.direction);
      sums.Clear(input.LocalCount(columns) - columns.pose_count());
      if (columns.any_intrinsic) {
        SumMarkers<true>(input, view, columns, *entry, line, estimate.positions, &sums, &cost);
      } else {
        SumMarkers<false>(input, view, columns, *entry, line, estimate.positions, &sums, &cost);
      }
      writer.rotation = view.rotation;
      writer.tangent[0] = Times(view.rotation, pose.tangent[0]);
      writer.tangent[1] = Times(view.rotation, pose.tangent[1]);
      AddInstantBlock(sums, view.rotation, writer.tangent, v);
      AddReducedBlocks(input, columns, &sums, line, writer, view_sums[entry->view]);
    }
    const double* const gradient = writer.At(input.column_count);
    for (int r = 0; r < kInstantColumns; ++r) {
      gradient_max = Max(gradient_max, Abs(Load(gradient + r * kLanes)));
    }
    Factorise(v, damping, gradient, factors + group * kFactorLanes * kLanes);
  }
  result->cost += cost.Cost(input);
  result->valid = result->valid && cost.Valid();
  for (int lane = 0; lane < kLanes; ++lane) {
    if (gradient_max[lane] > result->gradient_max) result->gradient_max = gradient_max[lane];
  }
}

}  // namespace rigcal::server::RIGCAL_KERNEL
