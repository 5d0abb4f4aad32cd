// SPDX-License-Identifier: Apache-2.0
// The same set of observations gives the same stored rows and the same calibration bit for bit, for
// any order, batching and repetition of its delivery to a real server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "common/simulation/world/simulated_world.h"
#include "common/wire/camera_wire.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::permuted_delivery_test {
namespace {

using Deliveries = std::vector<ObservationBatch>;

SimulatedWorld World() {
  SimulationOptions options;
  options.camera_count = 4;
  options.duration_s = 16;
  options.rate_hz = 10;
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  return *SimulatedWorld::Create(options, target);
}

// Batches of up to 16 rows for every camera, in the order of capture.
Deliveries InOrder(const SimulatedWorld& world) {
  Deliveries deliveries;
  for (size_t c = 0; c < world.cameras().size(); ++c) {
    const int camera = static_cast<int>(c);
    ObservationBatch batch;
    batch.stream.camera = world.cameras()[c].description.camera;
    batch.marker_count = 3;
    for (int frame = 0; frame < world.FrameCount(camera); ++frame) {
      batch.Append(world.Observe(camera, frame));
      if (batch.rows() == 16 || frame + 1 == world.FrameCount(camera)) {
        deliveries.push_back(batch);
        const uint32_t next = batch.end_seq();
        batch = batch.Slice(0, 0);
        batch.first_seq = next;
      }
    }
  }
  return deliveries;
}

Deliveries Singles(const Deliveries& deliveries) {
  Deliveries singles;
  for (const ObservationBatch& batch : deliveries) {
    for (ObservationBatch& row : SingleRows(batch)) singles.push_back(std::move(row));
  }
  return singles;
}

class PermutedDelivery : public ::testing::Test {
 protected:
  struct Outcome {
    std::string rows;
    std::string calibration;
    uint64_t observation_count = 0;
    uint32_t instant_count = 0;
  };

  Outcome Deliver(const Deliveries& deliveries) {
    v1::CreateSessionRequest request;
    *request.mutable_target() = wire::ToProto(world_.target());
    for (const SimulatedCamera& camera : world_.cameras()) {
      *request.add_cameras() = wire::ToProto(camera.description);
    }
    const auto session = client_.CreateSession(request);
    EXPECT_THAT(session, IsOk());
    const std::string id = session->id();
    EXPECT_THAT(client_.StartSession(id), IsOk());
    for (ObservationBatch batch : deliveries) {
      batch.stream.session_id = id;
      EXPECT_THAT(client_.Upload(batch), IsOk());
    }
    for (size_t c = 0; c < world_.cameras().size(); ++c) {
      const auto ack =
          client_.UploadEnd(id, world_.cameras()[c].description.camera, 1,
                            static_cast<uint32_t>(world_.FrameCount(static_cast<int>(c))));
      EXPECT_THAT(ack, IsOk());
      EXPECT_TRUE(ack->complete());
    }
    Outcome outcome;
    const auto finished = client_.WaitUntilFinished(id);
    EXPECT_THAT(finished, IsOk());
    outcome.observation_count = finished->observation_count();
    outcome.rows = ComparableBytes(*client_.ReadObservations(id));
    const auto calibration = client_.Calibrate(id);
    EXPECT_THAT(calibration, IsOk());
    EXPECT_EQ(calibration->state(), v1::Calibration::STATE_SUCCEEDED) << calibration->error();
    outcome.calibration = ComparableBytes(*calibration);
    outcome.instant_count = calibration->instant_count();
    return outcome;
  }

  void ExpectSameAsInOrder(const Deliveries& deliveries) {
    const Outcome reference = Deliver(InOrder(world_));
    const Outcome outcome = Deliver(deliveries);
    EXPECT_GT(reference.instant_count, 50u);
    EXPECT_EQ(outcome.observation_count, reference.observation_count);
    EXPECT_TRUE(outcome.rows == reference.rows) << "other rows are stored";
    EXPECT_TRUE(outcome.calibration == reference.calibration) << "another calibration came out";
  }

  const SimulatedWorld world_ = World();
  const TemporaryDirectory directory_;
  ServerProcess server_{directory_.path()};
  ServerClient client_{server_.address()};
};

TEST_F(PermutedDelivery, StoresEveryObservationOnce) {
  const Outcome outcome = Deliver(InOrder(world_));
  EXPECT_EQ(outcome.observation_count, 4u * 160u);
}

TEST_F(PermutedDelivery, ReversedBatches) {
  Deliveries deliveries = InOrder(world_);
  std::reverse(deliveries.begin(), deliveries.end());
  ExpectSameAsInOrder(deliveries);
}

TEST_F(PermutedDelivery, ReversedSingleObservations) {
  Deliveries deliveries = Singles(InOrder(world_));
  std::reverse(deliveries.begin(), deliveries.end());
  ExpectSameAsInOrder(deliveries);
}

TEST_F(PermutedDelivery, ShuffledTwiceWithBatchesAndSinglesMixed) {
  Deliveries deliveries = Singles(InOrder(world_));
  const Deliveries batches = InOrder(world_);
  deliveries.insert(deliveries.end(), batches.begin(), batches.end());
  std::mt19937 random(7);
  std::shuffle(deliveries.begin(), deliveries.end(), random);
  ExpectSameAsInOrder(deliveries);
}

TEST_F(PermutedDelivery, RepetitionAfterTheEndChangesNothing) {
  const Deliveries deliveries = InOrder(world_);
  const Outcome first = Deliver(deliveries);
  // Session ids are given in order of creation; the first one of this server:
  const auto session = client_.GetSession("s-000001");
  ASSERT_THAT(session, IsOk());
  for (ObservationBatch batch : deliveries) {
    batch.stream.session_id = session->id();
    ASSERT_THAT(client_.Upload(batch), IsOk());
  }
  const auto after = client_.GetSession(session->id());
  ASSERT_THAT(after, IsOk());
  EXPECT_EQ(after->observation_count(), first.observation_count);
  EXPECT_EQ(after->late_count(), 0u);
  EXPECT_TRUE(ComparableBytes(*client_.ReadObservations(session->id())) == first.rows);
  const auto again = client_.Calibrate(session->id());
  ASSERT_THAT(again, IsOk());
  EXPECT_TRUE(ComparableBytes(*again) == first.calibration) << "two runs differ";
}

}  // namespace
}  // namespace rigcal::testing::permuted_delivery_test
