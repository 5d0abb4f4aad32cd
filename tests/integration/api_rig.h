// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing {

// A server and an agent with three simulated cameras, for clients of the API.
class ApiRig : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::filesystem::path port_file = directory_.path() / "http_port";
    server_ = std::make_unique<ServerProcess>(
        directory_.path() / "store", 0, std::map<std::string, std::string>{},
        std::vector<std::string>{"--http-port-file", port_file.string()});
    std::ifstream(port_file) >> http_port_;
    ASSERT_GT(http_port_, 0) << server_->process().StandardError();
    std::string config;
    for (int i = 0; i < 3; ++i) {
      config += "[[camera]]\nsource = \"sim:camera=" + std::to_string(i) +
                ";cameras=3;duration=40;rate=50;speed=10\"\n";
    }
    directory_.WriteFile("agent.toml", config);
    agent_ = std::make_unique<Process>(Process::Options{
        {"rigcal-agent", "--config", (directory_.path() / "agent.toml").string(), "--server",
         server_->address(), "--state-dir", (directory_.path() / "agent").string()},
        {}});
    ASSERT_TRUE(WaitFor([&] {
      const auto agents = ServerClient(server_->address()).ListAgents();
      return agents.ok() && agents->size() == 1 && agents->at(0).connected();
    })) << agent_->StandardError();
  }
  std::string url() const { return "http://127.0.0.1:" + std::to_string(http_port_); }
  static std::filesystem::path Examples() {
    return std::filesystem::path(RIGCAL_SOURCE_DIR) / "docs" / "examples";
  }

  TemporaryDirectory directory_;
  std::unique_ptr<ServerProcess> server_;
  std::unique_ptr<Process> agent_;
  int http_port_ = 0;
};

}  // namespace rigcal::testing
