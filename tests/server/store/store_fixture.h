// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "common/session/session.h"
#include "server/store/store.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing {

// A session "s-test" of rig "rig" in state CAPTURING with these cameras and a wand of three
// markers.
Session CapturingSession(const std::vector<std::string>& cameras);

inline StreamKey KeyOf(std::string camera, uint32_t stream_epoch = 1) {
  return {.session_id = "s-test", .camera = std::move(camera), .stream_epoch = stream_epoch};
}

// Rows first_seq to last_seq of a stream; every value follows from camera, epoch and seq. Every
// fifth row is empty, every third has one marker hidden.
ObservationBatch MakeBatch(const StreamKey& stream, uint32_t first_seq, uint32_t last_seq,
                           uint32_t clock_epoch = 0);
bool HasWand(uint32_t seq);  // of a row of MakeBatch

server::Delivery MakeDelivery(ObservationBatch batch);
server::Delivery EndDelivery(const StreamKey& stream, uint32_t last_seq);

// One row with all its stored values.
struct StoredRow {
  uint32_t clock_epoch = 0;
  bool refused = false;
  bool late = false;
  std::string bytes;  // its values
  friend bool operator==(const StoredRow&, const StoredRow&) = default;
};
using RowKey = std::tuple<std::string, uint32_t, uint32_t>;  // camera, stream epoch, seq

// Every row of a session, one by one, in the order they were visited in. Fails the test where that
// is not ascending.
std::vector<std::pair<RowKey, StoredRow>> ReadRows(const server::Store& store,
                                                   std::string_view session_id = "s-test");
// The counts as text, for comparing.
std::string CountsText(const server::Store& store, std::string_view session_id = "s-test");

// An open store of the default kind in a folder of its own.
class StoreFixture : public ::testing::Test {
 protected:
  void SetUp() override { Open(); }
  virtual void Open();
  void Close() { store_.reset(); }
  void Reopen() {
    Close();
    Open();
  }
  server::Store& store() { return *store_; }
  std::filesystem::path folder() const { return directory_.path() / "data"; }
  // One delivery, which must succeed.
  server::AppendOutcome Append(const server::Delivery& delivery);
  server::AppendOutcome Append(ObservationBatch batch) {
    return Append(MakeDelivery(std::move(batch)));
  }

  TemporaryDirectory directory_;
  std::unique_ptr<server::Store> store_;
};

}  // namespace rigcal::testing
