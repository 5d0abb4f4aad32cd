// SPDX-License-Identifier: Apache-2.0
#include "tests/agent/spool/disk/model_file_system.h"

#include <algorithm>
#include <new>
#include <utility>

namespace rigcal::agent {
namespace {

std::string LastPart(const std::string& path) { return path.substr(path.rfind('/') + 1); }

}  // namespace

class ModelFileSystem::File final : public SpoolFile {
 public:
  File(ModelFileSystem* model, std::shared_ptr<Inode> inode)
      : model_(*model), inode_(std::move(inode)) {}

  absl::Status WriteAt(uint64_t offset, std::string_view bytes) override {
    const std::lock_guard lock(model_.mutex_);
    absl::Status status = model_.Pass();
    if (status.ok() && model_.BytesLocked() + bytes.size() > model_.capacity_) {
      status = absl::ResourceExhaustedError("the model is full");
    }
    // A write that fails may have done a part of its work.
    if (!status.ok()) bytes = bytes.substr(0, model_.power_is_off_ ? 0 : bytes.size() / 2);
    std::string& content = inode_->content;
    if (!bytes.empty()) {
      content.resize(std::max<size_t>(content.size(), offset + bytes.size()));
      content.replace(offset, bytes.size(), bytes);
    }
    return status;
  }

  absl::StatusOr<std::string> ReadAt(uint64_t offset, size_t size) override {
    const std::lock_guard lock(model_.mutex_);
    if (model_.power_is_off_) return absl::InternalError("the power is off");
    if (offset >= inode_->content.size()) return std::string();
    std::string bytes = inode_->content.substr(offset, size);
    model_.bytes_read_ += bytes.size();
    return bytes;
  }

  absl::Status Truncate(uint64_t size) override {
    const std::lock_guard lock(model_.mutex_);
    absl::Status status = model_.Pass();
    if (status.ok()) inode_->content.resize(size);
    return status;
  }

  absl::Status Sync() override {
    const std::lock_guard lock(model_.mutex_);
    if (inode_->sync_failed) model_.synced_again_ = true;
    absl::Status status = model_.Pass();
    if (status.ok()) {
      inode_->synced = inode_->content;
    } else if (!model_.power_is_off_) {
      inode_->sync_failed = true;
    }
    return status;
  }

 private:
  ModelFileSystem& model_;
  const std::shared_ptr<Inode> inode_;
};

absl::Status ModelFileSystem::Pass() {
  ++calls_;
  if (cut_at_ > 0 && --cut_at_ == 0) power_is_off_ = true;
  if (power_is_off_) return absl::InternalError("the power is off");
  if (throw_at_ > 0 && --throw_at_ == 0) throw std::bad_alloc();
  if (fail_at_ == 0) return absl::OkStatus();
  if (fail_at_ > 1) {
    --fail_at_;
    return absl::OkStatus();
  }
  if (!forever_) fail_at_ = 0;
  return absl::Status(code_, "the model fails");
}

void ModelFileSystem::FailAt(int call, absl::StatusCode code, bool forever) {
  const std::lock_guard lock(mutex_);
  fail_at_ = call;
  code_ = code;
  forever_ = forever;
}

void ModelFileSystem::ThrowAt(int call) {
  const std::lock_guard lock(mutex_);
  throw_at_ = call;
}

void ModelFileSystem::CutPowerAt(int call) {
  const std::lock_guard lock(mutex_);
  cut_at_ = call;
}

void ModelFileSystem::PowerCut(size_t keep_unsynced_bytes) {
  const std::lock_guard lock(mutex_);
  power_is_off_ = false;
  cut_at_ = fail_at_ = 0;
  names_ = synced_names_;
  for (auto& [name, inode] : names_) {
    const auto& content = inode->content;
    std::string kept = inode->synced;
    if (content.size() > kept.size()) kept += content.substr(kept.size(), keep_unsynced_bytes);
    inode->content = inode->synced = std::move(kept);
  }
}

void ModelFileSystem::Freeze() {
  const std::lock_guard lock(mutex_);
  power_is_off_ = true;
}

void ModelFileSystem::Thaw() {
  const std::lock_guard lock(mutex_);
  power_is_off_ = false;
  cut_at_ = fail_at_ = 0;
}

uint64_t ModelFileSystem::bytes_read() const {
  const std::lock_guard lock(mutex_);
  return bytes_read_;
}

void ModelFileSystem::SetCapacity(uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  capacity_ = bytes;
}

int ModelFileSystem::calls() const {
  const std::lock_guard lock(mutex_);
  return calls_;
}

uint64_t ModelFileSystem::BytesLocked() const {
  uint64_t sum = 0;
  for (const auto& [name, inode] : names_) sum += inode->content.size();
  return sum;
}

uint64_t ModelFileSystem::bytes() const {
  const std::lock_guard lock(mutex_);
  return BytesLocked();
}

bool ModelFileSystem::synced_again() const {
  const std::lock_guard lock(mutex_);
  return synced_again_;
}

std::vector<std::string> ModelFileSystem::Names() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> names;
  for (const auto& [name, inode] : names_) names.push_back(name);
  return names;
}

std::string ModelFileSystem::Content(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  return names_.at(name)->content;
}

void ModelFileSystem::SetContent(const std::string& name, std::string content) {
  const std::lock_guard lock(mutex_);
  auto inode = std::make_shared<Inode>();
  inode->content = inode->synced = std::move(content);
  names_[name] = synced_names_[name] = std::move(inode);
}

void ModelFileSystem::Erase(const std::string& name) {
  const std::lock_guard lock(mutex_);
  names_.erase(name);
  synced_names_.erase(name);
}

absl::Status ModelFileSystem::CreateFolder(const std::string&) {
  const std::lock_guard lock(mutex_);
  return Pass();
}

absl::StatusOr<std::vector<FileSystem::Entry>> ModelFileSystem::List(const std::string&) {
  const std::lock_guard lock(mutex_);
  std::vector<Entry> entries;
  for (const auto& [name, inode] : names_) entries.push_back({name, inode->content.size()});
  return entries;
}

absl::StatusOr<std::shared_ptr<SpoolFile>> ModelFileSystem::Create(const std::string& path) {
  const std::lock_guard lock(mutex_);
  if (absl::Status status = Pass(); !status.ok()) return status;
  auto inode = std::make_shared<Inode>();
  names_[LastPart(path)] = inode;
  return std::make_shared<File>(this, std::move(inode));
}

absl::StatusOr<std::shared_ptr<SpoolFile>> ModelFileSystem::Open(const std::string& path) {
  const std::lock_guard lock(mutex_);
  if (power_is_off_) return absl::InternalError("the power is off");
  const auto found = names_.find(LastPart(path));
  if (found == names_.end()) return absl::NotFoundError(path);
  return std::make_shared<File>(this, found->second);
}

absl::Status ModelFileSystem::Rename(const std::string& from, const std::string& to) {
  const std::lock_guard lock(mutex_);
  if (absl::Status status = Pass(); !status.ok()) return status;
  const auto found = names_.find(LastPart(from));
  if (found == names_.end()) return absl::NotFoundError(from);
  names_[LastPart(to)] = found->second;
  names_.erase(LastPart(from));
  return absl::OkStatus();
}

absl::Status ModelFileSystem::Remove(const std::string& path) {
  const std::lock_guard lock(mutex_);
  if (absl::Status status = Pass(); !status.ok()) return status;
  names_.erase(LastPart(path));
  return absl::OkStatus();
}

absl::Status ModelFileSystem::SyncFolder(const std::string&) {
  const std::lock_guard lock(mutex_);
  if (absl::Status status = Pass(); !status.ok()) return status;
  synced_names_ = names_;
  return absl::OkStatus();
}

absl::StatusOr<std::shared_ptr<void>> ModelFileSystem::Lock(const std::string& path) {
  const std::lock_guard lock(mutex_);
  if (lock_.use_count() > 1) return absl::AlreadyExistsError(path + " is locked");
  return std::shared_ptr<void>(lock_);
}

}  // namespace rigcal::agent
