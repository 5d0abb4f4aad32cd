// SPDX-License-Identifier: Apache-2.0
#include "common/export/archive.h"

#include <archive.h>
#include <archive_entry.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "tests/testing/status_matchers.h"

namespace rigcal::archive_test {
namespace {

using ::testing::ElementsAre;
using ::testing::FieldsAre;
using ::testing::IsEmpty;

std::vector<ExportFile> FilesIn(const std::string& zip) {
  std::vector<ExportFile> files;
  struct archive* const reader = archive_read_new();
  archive_read_support_format_zip(reader);
  EXPECT_EQ(archive_read_open_memory(reader, zip.data(), zip.size()), ARCHIVE_OK);
  for (archive_entry* entry = nullptr; archive_read_next_header(reader, &entry) == ARCHIVE_OK;) {
    ExportFile& file = files.emplace_back();
    file.name = archive_entry_pathname(entry);
    char buffer[4096];
    for (la_ssize_t count; (count = archive_read_data(reader, buffer, sizeof buffer)) > 0;) {
      file.content.append(buffer, static_cast<size_t>(count));
    }
  }
  archive_read_free(reader);
  return files;
}

TEST(ZipOf, HoldsWhatWasGiven) {
  const std::string large(100'000, 'x');
  const std::vector<ExportFile> files = {{"a.yaml", "one\n"}, {"b.yaml", ""}, {"c", large}};
  ASSERT_OK_AND_ASSIGN(const std::string zip, ZipOf(files));
  EXPECT_THAT(FilesIn(zip), ElementsAre(FieldsAre("a.yaml", "one\n"), FieldsAre("b.yaml", ""),
                                        FieldsAre("c", large)));
  EXPECT_LT(zip.size(), large.size()) << "it is compressed";
}

TEST(ZipOf, IsTheSameForTheSameFiles) {
  const std::vector<ExportFile> files = {{"a.yaml", "one\n"}, {"b.yaml", "two\n"}};
  ASSERT_OK_AND_ASSIGN(const std::string first, ZipOf(files));
  ASSERT_OK_AND_ASSIGN(const std::string second, ZipOf(files));
  EXPECT_EQ(first, second);
}

TEST(ZipOf, CanBeEmpty) {
  ASSERT_OK_AND_ASSIGN(const std::string zip, ZipOf({}));
  EXPECT_THAT(FilesIn(zip), IsEmpty());
}

}  // namespace
}  // namespace rigcal::archive_test
