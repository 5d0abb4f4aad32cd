// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/server_roster.h"

namespace rigcal::server {

// The files of a data folder that every server of a store needs: who owns which camera, the
// settings of monitored rigs, the certificate authority with what it has given out. The server that
// has the turn writes what changes in them to the store; those that wait have copies. The
// certificate of the server itself and its audit log are its own.
class SharedFiles {
 public:
  // `roster` must outlive this object.
  SharedFiles(std::filesystem::path data_dir, ServerRoster* roster)
      : data_dir_(std::move(data_dir)), roster_(*roster) {}
  ~SharedFiles() { Stop(); }

  // Writes what others have changed. False: the store has none yet.
  //   FAILED_PRECONDITION  this folder has the key of another certificate authority
  absl::StatusOr<bool> Fetch();
  // Writes what has changed here to the store, at once and from then on.
  absl::Status Publish();
  void Stop();

 private:
  // Changes with every change of a file.
  using Version = std::string;
  static Version VersionOf(const std::filesystem::path& file);
  absl::Status PublishChanges();
  void Run();

  const std::filesystem::path data_dir_;
  ServerRoster& roster_;
  int64_t fetched_ = 0;
  std::map<std::string, Version> published_;
  bool failed_ = false;

  std::mutex mutex_;
  std::condition_variable stop_changed_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace rigcal::server
