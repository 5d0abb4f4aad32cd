// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace Metavision {

class DataTransfer {
 public:
  using Data = uint8_t;

#if FAKE_METAVISION_MAJOR >= 5
  // Keeps its bytes alive.
  class BufferPtr {
   public:
    using PtrType = const Data*;

    BufferPtr() = default;
    explicit BufferPtr(std::shared_ptr<std::vector<Data>> bytes) : bytes_(std::move(bytes)) {}

    operator bool() const noexcept { return bytes_ != nullptr; }  // NOLINT: as the SDK has it
    std::size_t size() const noexcept { return bytes_ ? bytes_->size() : 0; }
    PtrType data() const noexcept { return bytes_ ? bytes_->data() : nullptr; }

   private:
    std::shared_ptr<std::vector<Data>> bytes_;
  };
#endif
};

}  // namespace Metavision
