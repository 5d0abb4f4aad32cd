// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/solve/bundle/marker_residual.h"

namespace rigcal::server {

// The inner loops of SolveLineBundle on plain arrays, compiled for several instruction sets. Eight
// instants (a group) go through the arithmetic side by side, one per lane. "Columns" are those of
// the reduced system (line_bundle_layout.h); an array of lanes holds its eight doubles in a row.
//
// Whatever the instruction set, the same operations happen in the same order and nothing is fused:
// every set gives the same bits. This header is compiled for instruction sets that the CPU may not
// have, so it includes nothing that could leave code behind for others to link.

inline constexpr int kGroupSize = 8;        // instants side by side
inline constexpr int kInstantColumns = 5;   // origin x y z, direction in its tangent basis
inline constexpr int kTileSize = 8;         // columns of the reduced matrix side by side
inline constexpr int kMaxBatchGroups = 8;   // a batch's instants fit the bits of one word
inline constexpr int kMaxLineMarkers = 32;  // of one target
inline constexpr int kMaxBaseColumns = ViewUnknowns::kMaxCount;

// Per marker slot of an entry: upper triangle a b c of the root of the information (r = [a b; 0 c]
// (p - u + dt u')), centre u (2), velocity u' (2), lanes each. a = c = 0: the lane has no such
// marker.
inline constexpr int kSlotLanes = 7;
// Per group: origin (3), direction (3).
inline constexpr int kPoseLanes = 6;
// Per group: inverse pivots (5) and strict lower triangle (10, by rows) of the Cholesky factor of
// the damped block, the block's diagonal without damping (5), the gradient (5).
inline constexpr int kFactorLanes = 25;

// The observations of one view (a camera under one clock) in one group.
struct KernelEntry {
  int view = 0;
  uint32_t slots = 0;  // bit m: some lane has marker m
  uint8_t lanes = 0;   // bit k: lane k has an observation
  size_t data = 0;     // into KernelInput::data: clock time, then kSlotLanes for each bit of slots
};

// Which derivatives of a view are free and their columns. Base columns are ViewUnknowns, in their
// order.
struct KernelColumns {
  int pose = -1;  // first of rotation vector (3, left, in the camera's frame) and translation (3)
  int base_count = 0;
  int base_kind[kMaxBaseColumns] = {};  // of ViewUnknowns
  int base_column[kMaxBaseColumns] = {};
  bool any_intrinsic = false;

  int pose_count() const { return pose < 0 ? 0 : 6; }
};

// The constant part of a problem.
struct KernelInput {
  bool robust = false;
  double loss_scale = 1;
  bool curved = false;  // the matrix has the loss's own second derivative, not only its weights
  int marker_count = 0;
  int column_count = 0;     // n; column n of the accumulated system is the gradient
  int spacing_column = -1;  // of marker 1; -1: fixed
  int group_count = 0;
  int batch_groups = 1;                    // room for so many groups in the coupling
  const KernelColumns* columns = nullptr;  // by view
  const KernelEntry* entries = nullptr;    // by group, by view within a group
  const uint32_t* first_entry = nullptr;   // by group, group_count + 1
  const double* data = nullptr;            // lanes
  // Where not all data is kept: puts that of one group into `data`, to which the group's entries
  // then refer. None: `data` is that of every group.
  void (*load)(const void* source, int group) = nullptr;
  const void* source = nullptr;
  int first_group = 0;  // of the source's, that group 0 here is

  void Load(int group) const {
    if (load != nullptr) load(source, first_group + group);
  }
  int tile_count() const { return column_count / kTileSize + 1; }
  // Derivatives of a view in the order the view's sums use: pose, base, gradient, spacing.
  int LocalCount(const KernelColumns& view_columns) const {
    return view_columns.pose_count() + view_columns.base_count + 1 +
           (spacing_column < 0 ? 0 : marker_count - 1);
  }
};

// Estimates: views, positions of the markers along the target, kPoseLanes per group.
struct KernelEstimate {
  const ViewEstimate<double>* views = nullptr;
  const double* positions = nullptr;
  const double* poses = nullptr;
};

// A step of the reduced parameters: by column, and what its sums of squares are made of.
struct KernelStepResult {
  double cost = 0;            // at the new estimates, priors not counted
  bool valid = true;          // false: a marker cannot be seen from where its camera has gone
  double model_decrease = 0;  // the instants' part
  double step_norm2 = 0;      // of the instants
  double norm2 = 0;           // of the instants' values before the step
};

struct KernelLinearisation {
  double cost = 0;
  bool valid = true;
  double gradient_max = 0;  // of the instants
};

// A run of groups [first, last), and the tiles of columns that they reach.
struct KernelBatch {
  int first = 0;
  int last = 0;
  int tile_count = 0;
  const int* tiles = nullptr;       // ascending
  const uint64_t* masks = nullptr;  // by tile of `tiles`; bit k: instant k of the batch reaches it
  const int* places = nullptr;      // by tile of columns: where in `tiles`, if it is there
};

struct LineBundleKernel {
  const char* name;

  // Linearises a batch at `estimate`. Writes `factors`, adds to `view_sums` (per view: lower
  // triangle of its local columns, lanes) and fills `coupling`: for each tile of the batch, each
  // group: [column][instant column][lane].
  void (*linearise)(const KernelInput& input, const KernelBatch& batch,
                    const KernelEstimate& estimate, double damping, double* factors,
                    double* const* view_sums, double* coupling, KernelLinearisation* result);
  // Multiplies the coupling with the inverse Cholesky factors and turns it to
  // [lane][instant column][column].
  void (*whiten)(const KernelInput& input, const KernelBatch& batch, const double* factors,
                 double* coupling);
  // tiles -= coupling^T coupling. Tile (i, j), i >= j, is number rows[i] + j, each row by row.
  void (*eliminate)(const KernelInput& input, const KernelBatch& batch, const std::ptrdiff_t* rows,
                    const double* coupling, double* tiles);
  // Steps the instants of all groups given the step of the reduced parameters, and evaluates the
  // cost at the new estimates (`moved`, whose poses are written).
  void (*step)(const KernelInput& input, const KernelEstimate& estimate, double damping,
               const double* reduced_step, const double* factors, const KernelEstimate& moved,
               double* moved_poses, KernelStepResult* result);
  // The cost alone.
  void (*evaluate)(const KernelInput& input, const KernelEstimate& estimate,
                   KernelStepResult* result);
};

// The diagonal that `damping` times is added to: bounded away from zero as Ceres does.
inline constexpr double kMinDiagonal = 1e-6;
inline constexpr double kMaxDiagonal = 1e32;

// The best this CPU has; all that it has, the plainest first.
const LineBundleKernel& BestLineBundleKernel();
std::vector<const LineBundleKernel*> AvailableLineBundleKernels();

}  // namespace rigcal::server
