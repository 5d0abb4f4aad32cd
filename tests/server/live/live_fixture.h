// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/live/live_tracker.h"
#include "tests/server/session/session_fixture.h"

namespace rigcal::testing {

// A live tracker whose time stands still until a test moves it.
class LiveFixture : public SessionFixture {
 protected:
  void SetUp() override;
  void TearDown() override;
  void OpenTracker();
  // As after kill -9 of the server.
  void RestartTracker();

  // Agent "pc" with these cameras, and a session "wave" that captures with them.
  ConnectedAgent StartWave(const std::vector<std::string>& cameras,
                           const std::function<void(Session*)>& change = {});

  // A row of one camera at a time; moves the markers.
  using MakeRow = std::function<void(double time_s, Observation* row)>;
  // The wand of three markers, seen at a place that moves slowly.
  static void SeeWand(double time_s, Observation* row);
  static void SeeNothing(double time_s, Observation* row);
  // Lets the time pass in steps of 100 ms, in each of which every camera delivers five rows at 50
  // Hz and the state is made.
  void Wave(double duration_s, const std::map<std::string, MakeRow>& cameras);
  void Pass(double duration_s) { Wave(duration_s, {}); }
  // One batch of one camera through the store to the tracker.
  void Send(const std::string& camera, double first_s, int rows, const MakeRow& make_row,
            const std::function<void(server::Delivery*)>& change = {});

  std::shared_ptr<const server::LiveSnapshot> state() { return tracker_->Get("rig"); }
  const server::LiveCamera& camera(const std::string& name) {
    held_ = state();
    return *held_->cameras.at(name).value;
  }
  std::vector<server::LiveAlert> alerts();
  // "error no_wand left", one for each alert.
  std::vector<std::string> AlertTexts();

  double now_s_ = 100;
  std::string session_id_ = "wave";  // whose rows are sent
  // Added to the times of the camera's rows.
  std::map<std::string, double> clock_offset_s_;
  std::map<std::string, uint32_t> clock_epoch_;
  std::unique_ptr<server::LiveTracker> tracker_;

 private:
  std::map<std::pair<std::string, std::string>, uint32_t> next_seq_;  // by session and camera
  std::shared_ptr<const server::LiveSnapshot> held_;
};

}  // namespace rigcal::testing
