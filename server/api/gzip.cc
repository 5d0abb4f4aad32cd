// SPDX-License-Identifier: Apache-2.0
#include "server/api/gzip.h"

#include <zlib.h>

#include <cstring>

namespace rigcal::server {
namespace {

constexpr int kGzipWindow = 15 + 16;  // zlib: the largest window, with a header of gzip
constexpr int kMemoryLevel = 8;

}  // namespace

std::string Gzipped(std::string_view text, int level) {
  z_stream stream{};
  if (deflateInit2(&stream, level, Z_DEFLATED, kGzipWindow, kMemoryLevel, Z_DEFAULT_STRATEGY) !=
      Z_OK) {
    return {};
  }
  std::string bytes(deflateBound(&stream, text.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(bytes.data());
  stream.avail_out = static_cast<uInt>(bytes.size());
  const int result = deflate(&stream, Z_FINISH);
  bytes.resize(result == Z_STREAM_END ? stream.total_out : 0);
  deflateEnd(&stream);
  return bytes;
}

absl::StatusOr<std::string> Gunzipped(std::string_view bytes, size_t max_bytes) {
  z_stream stream{};
  if (inflateInit2(&stream, kGzipWindow) != Z_OK) return absl::InternalError("zlib cannot start");
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  std::string text;
  int result = Z_OK;
  while (result == Z_OK && text.size() <= max_bytes) {
    const size_t before = text.size();
    text.resize(before + (size_t{64} << 10));
    stream.next_out = reinterpret_cast<Bytef*>(text.data() + before);
    stream.avail_out = static_cast<uInt>(text.size() - before);
    result = inflate(&stream, Z_NO_FLUSH);
    text.resize(text.size() - stream.avail_out);
  }
  inflateEnd(&stream);
  if (result == Z_STREAM_END && text.size() <= max_bytes) return text;
  return absl::DataLossError("the compressed bytes are damaged");
}

}  // namespace rigcal::server
