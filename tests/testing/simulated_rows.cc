// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/simulated_rows.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <string>
#include <tuple>

namespace rigcal::testing {
namespace {

auto ColumnsOf(const ObservationBatch& batch) {
  return std::tie(batch.clock_epoch, batch.marker_count, batch.time_ns, batch.visible_mask,
                  batch.x_px, batch.y_px, batch.cov_xx_px2, batch.cov_xy_px2, batch.cov_yy_px2,
                  batch.time_delta_ns, batch.label_confidence, batch.centre_kind);
}

}  // namespace

void ExpectSimulatedRows(const SimulatedWorld& world, const std::vector<ObservationBatch>& batches,
                         const v1::Session& session) {
  std::map<std::string, uint32_t> last;
  for (const ObservationBatch& batch : batches) {
    const std::string& name = batch.stream.camera;
    ASSERT_EQ(batch.first_seq, last[name] + 1) << name << ": lost, repeated or out of order";
    const int camera = std::stoi(name.substr(name.find('_') + 1));
    ObservationBatch truth;
    truth.clock_epoch = batch.clock_epoch;
    truth.marker_count = static_cast<uint32_t>(world.target().marker_count());
    for (uint32_t seq = batch.first_seq; seq < batch.end_seq(); ++seq) {
      truth.Append(world.Observe(camera, static_cast<int>(seq) - 1));
    }
    ASSERT_TRUE(ColumnsOf(batch) == ColumnsOf(truth))
        << name << ": not what was detected, among observations " << batch.first_seq << " to "
        << batch.end_seq() - 1;
    last[name] = batch.end_seq() - 1;
  }
  for (const v1::SessionCamera& camera : session.cameras()) {
    const std::string& name = camera.description().camera();
    ASSERT_EQ(camera.streams_size(), 1) << name;
    EXPECT_TRUE(camera.streams(0).ended()) << name;
    EXPECT_EQ(camera.streams(0).last_seq(), last[name]) << name;
    EXPECT_EQ(camera.conflict_count(), 0u) << name;
    EXPECT_EQ(camera.damaged_count(), 0u) << name;
  }
}

}  // namespace rigcal::testing
