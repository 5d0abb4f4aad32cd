// SPDX-License-Identifier: Apache-2.0
// Points triangulated with a calibration, against ground truth: their error by cell of space beside
// the one that is predicted for them.
#include <fmt/core.h>

#include <cmath>
#include <vector>

#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/solver_experiments.h"
#include "tests/accuracy/solver/triangulate_experiment.h"

namespace rigcal::accuracy {
namespace {

constexpr double kAllowedShare = 0.15;
constexpr int kMinPointsOfVoxel = 200;

struct TriangulateCase {
  const char* name;
  bool free_running;
  double jump_share;  // of markers not seen, and put anywhere
};

constexpr TriangulateCase kTriangulateCases[] = {
    {"together", false, 0}, {"freely running", true, 0}, {"dropouts, outliers", false, 0.03}};

void PrintVoxels(const char* name, const std::vector<VoxelErrors>& voxels, int seeds) {
  double lowest = 1e9, highest = 0;
  int within = 0, counted = 0;
  for (const VoxelErrors& voxel : voxels) {
    if (voxel.count < kMinPointsOfVoxel) continue;
    const double ratio = std::sqrt(voxel.squared_m2 / voxel.predicted_m2);
    lowest = std::min(lowest, ratio);
    highest = std::max(highest, ratio);
    within += std::abs(ratio - 1) <= kAllowedShare ? 1 : 0;
    ++counted;
  }
  const VoxelErrors all = SumOf(voxels);
  fmt::print(
      "{:20} {:5} {:8} {:8.3f} {:9.3f} {:6.3f} {:6.3f} {:4} of {:2} {:7.3f} {:7.3f} {:7.3f}\n",
      name, seeds, all.count, 1e3 * std::sqrt(all.squared_m2 / all.count),
      1e3 * std::sqrt(all.predicted_m2 / all.count), std::sqrt(all.squared_m2 / all.predicted_m2),
      std::sqrt(all.squared_m2 / all.stated_m2), within, counted, lowest, highest,
      all.nees / (3 * all.count));
}

void PrintVoxelTable(const std::vector<VoxelErrors>& voxels) {
  for (int x = 0; x < kVoxelsPerSide; ++x) {
    for (int y = 0; y < kVoxelsPerSide; ++y) {
      fmt::print("   ");
      for (int z = 0; z < kVoxelsPerSide; ++z) {
        const VoxelErrors& voxel =
            voxels[static_cast<size_t>((x * kVoxelsPerSide + y) * kVoxelsPerSide + z)];
        if (voxel.count == 0) {
          fmt::print("  {:>21}", "-");
          continue;
        }
        fmt::print("  {:6.3f}/{:6.3f} ({:5})", 1e3 * std::sqrt(voxel.squared_m2 / voxel.count),
                   1e3 * std::sqrt(voxel.predicted_m2 / voxel.count), voxel.count);
      }
      fmt::print("\n");
    }
  }
}

int RunTriangulate(const SeedOptions& seeds) {
  fmt::print(
      "{} cameras, {} s at 25 Hz, 0.3 px; the last quarter triangulated with a calibration of the "
      "rest; spans of the wand known to 0.1 mm; {} cells\n",
      seeds.camera_count, seeds.duration_s, kVoxelsPerSide * kVoxelsPerSide * kVoxelsPerSide);
  fmt::print("{:20} {:>5} {:>8} {:>8} {:>9} {:>13} {:>10} {:>15} {:>7}\n", "", "", "", "error",
             "predicted", "error by", "cells in", "error/predicted", "NEES");
  fmt::print("{:20} {:>5} {:>8} {:>8} {:>9} {:>6} {:>6} {:>10} {:>7} {:>7} {:>7}\n", "case",
             "seeds", "points", "rms mm", "rms mm", "pred.", "own", "15 %", "least", "most", "/3");
  for (const TriangulateCase& entry : kTriangulateCases) {
    if (!seeds.only.empty() && std::string(entry.name).find(seeds.only) == std::string::npos) {
      continue;
    }
    const auto trials = RunAll<TriangulateTrial>(seeds.count, seeds.threads, [&](int i) {
      SimulationOptions simulation;
      simulation.seed = static_cast<uint32_t>(seeds.first + i);
      simulation.camera_count = seeds.camera_count;
      simulation.duration_s = seeds.duration_s;
      simulation.free_running = entry.free_running;
      simulation.outlier_share = simulation.dropout_share = entry.jump_share;
      simulation.time_offset_s = {{1, 0.008}, {2, -0.013}};
      if (!entry.free_running) simulation.time_offset_s.clear();
      return RunTriangulateTrial(simulation);
    });
    std::vector<VoxelErrors> voxels(trials.empty() ? 0 : trials[0].voxels.size());
    int good = 0;
    for (size_t i = 0; i < trials.size(); ++i) {
      if (!trials[i].status.ok()) {
        fmt::print("seed {}: FAILED: {}\n", seeds.first + static_cast<int>(i),
                   trials[i].status.ToString());
        continue;
      }
      ++good;
      voxels.resize(trials[i].voxels.size());
      for (size_t v = 0; v < voxels.size(); ++v) voxels[v].Add(trials[i].voxels[v]);
    }
    if (good == 0) continue;
    PrintVoxels(entry.name, voxels, good);
    if (seeds.verbose) PrintVoxelTable(voxels);
  }
  return 0;
}

}  // namespace

Experiment Triangulate() {
  SeedOptions defaults;
  defaults.count = 100;
  return SeedExperiment("triangulate", "errors of triangulated points against their prediction",
                        defaults, RunTriangulate);
}

}  // namespace rigcal::accuracy
