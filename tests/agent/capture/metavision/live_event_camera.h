// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "agent/capture/metavision/metavision_event_source.h"
#include "tests/testing/fake_metavision/fake_event_camera.h"
#include "tests/testing/temporary_directory.h"

// For tests of live event cameras, on a stand-in for the SDK. Each is built twice: in the way of
// the SDK's versions 4.x and of 5.x.
namespace rigcal::agent {

// The fake SDK with no camera plugged in, and sources on it.
class LiveEventCameraTest : public ::testing::Test {
 protected:
  LiveEventCameraTest() { testing::FakeBus::Get().Reset(); }
  ~LiveEventCameraTest() override { testing::FakeBus::Get().Reset(); }

  static MetavisionSourceOptions Options() {
    MetavisionSourceOptions options;
    options.camera = "left";
    options.shortest_pause = std::chrono::milliseconds(1);
    options.longest_pause = std::chrono::milliseconds(2);
    return options;
  }

  // With a file of settings.
  MetavisionSourceOptions WithSettings(const std::string& toml) {
    MetavisionSourceOptions options = Options();
    options.settings_path = directory_.WriteFile("biases.toml", toml).string();
    return options;
  }

  static absl::Status CreateStatus(const MetavisionSourceOptions& options) {
    return MetavisionEventSource::Create(options).status();
  }

  testing::TemporaryDirectory directory_;
  const Target target_;
};

}  // namespace rigcal::agent
