// SPDX-License-Identifier: Apache-2.0
#include "server/turn/shared_files.h"

#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <chrono>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/file/private_folder.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

constexpr std::chrono::milliseconds kLookInterval{200};
constexpr char kCertificateAuthority[] = "identity/ca.crt";
// What says that the others are there; it has no file.
constexpr char kComplete[] = "complete";
// A key before the certificate that names it.
constexpr const char* kNames[] = {"agents.json",
                                  "monitors.json",
                                  "identity/ca.key",
                                  "identity/identities.json",
                                  "identity/denied.json",
                                  "identity/tokens.json",
                                  "identity/spent_tokens.json",
                                  "identity/web_sessions.json",
                                  kCertificateAuthority};

bool IsShared(const std::string& name) {
  for (const char* shared : kNames) {
    if (name == shared) return true;
  }
  return false;
}

}  // namespace

SharedFiles::Version SharedFiles::VersionOf(const std::filesystem::path& file) {
  struct stat status {};
  if (stat(file.c_str(), &status) != 0) return "";
  return absl::StrCat(status.st_ino, " ", status.st_size, " ", status.st_mtim.tv_sec, " ",
                      status.st_mtim.tv_nsec);
}

absl::StatusOr<bool> SharedFiles::Fetch() {
  int64_t version = fetched_;
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<SharedDocument> documents,
                          roster_.ReadDocuments(&version));
  for (const SharedDocument& document : documents) {
    if (document.name != kCertificateAuthority || fetched_ != 0) continue;
    const auto own = ReadSmallFile(data_dir_ / document.name);
    if (!own.ok() || own.value() == document.text.value_or("")) continue;
    return absl::FailedPreconditionError(absl::StrCat(
        (data_dir_ / "identity").string(),
        " is of another certificate authority than the servers of this database use; start with "
        "an empty --data-dir: the keys come from the database"));
  }
  for (const SharedDocument& document : documents) {
    if (!IsShared(document.name)) continue;  // of a later version
    const std::filesystem::path file = data_dir_ / document.name;
    if (document.text) {
      RIGCAL_RETURN_IF_ERROR(MakePrivateFolder(file.parent_path()));
      RIGCAL_RETURN_IF_ERROR(WriteDurableFile(file, *document.text));
    } else {
      std::error_code error;
      std::filesystem::remove(file, error);
    }
    published_[document.name] = VersionOf(file);
  }
  fetched_ = version;
  return fetched_ != 0;
}

absl::Status SharedFiles::Publish() {
  RIGCAL_RETURN_IF_ERROR(PublishChanges());
  thread_ = std::thread([this] { Run(); });
  return absl::OkStatus();
}

absl::Status SharedFiles::PublishChanges() {
  std::vector<SharedDocument> changes;
  std::map<std::string, Version> published = published_;
  for (const std::string name : kNames) {
    const std::filesystem::path file = data_dir_ / name;
    const Version version = VersionOf(file);
    if (version == published[name]) continue;
    published[name] = version;
    changes.push_back({.name = name});
    if (version.empty()) continue;
    RIGCAL_ASSIGN_OR_RETURN(changes.back().text, ReadWholeFile(file, size_t{64} << 20));
  }
  if (published.emplace(kComplete, "yes").second) changes.push_back({.name = kComplete});
  if (changes.empty()) return absl::OkStatus();
  RIGCAL_RETURN_IF_ERROR(roster_.WriteDocuments(changes));
  published_ = std::move(published);
  return absl::OkStatus();
}

void SharedFiles::Run() {
  std::unique_lock lock(mutex_);
  while (!stop_changed_.wait_for(lock, kLookInterval, [this] { return stop_; })) {
    const absl::Status status = PublishChanges();
    if (!status.ok() && !failed_) {
      spdlog::warn("the other servers do not get what changes in {} at the moment: {}",
                   data_dir_.string(), std::string(status.message()));
    }
    failed_ = !status.ok();
  }
}

void SharedFiles::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  stop_changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

}  // namespace rigcal::server
