// SPDX-License-Identifier: Apache-2.0
//
// The sinks of wrong/wrong_sink.cpp, and exactly the tests that find each.
#pragma once

#include "matrix.hpp"

namespace arhost::test {

inline const std::vector<WrongPlugin> wrong_sinks = of_kind(
    "sink",
    {
        {"none", "nothing", "pass", {}},
        {"dates_its_files", "writes the time to its files", "pass", {}},
        {"writes_more_files", "writes a second file per frame, and one for the last frame", "pass", {}},
        {"no_write", "has no write", "fail", {"abi.load"}},
        {"crash_in_start", "crashes in start", "crashed", {"sink.start"}},
        {"crash_in_write", "crashes in write", "crashed", {"sink.write"}},
        {"crash_in_idle", "crashes in idle", "crashed", {"sink.idle"}},
        {"crash_in_stop", "crashes in stop", "crashed", {"sink.start"}},
        {"crash_after_a_failed_start", "crashes in destroy after a failed start", "crashed", {"sink.no-place"}},
        {"crash_on_1x1", "crashes on a frame of one pixel", "crashed", {"sink.sizes"}},
        {"crash_on_64_markers", "crashes on a frame with 64 markers", "crashed", {"sink.records"}},
        {"crash_on_a_full_disk", "crashes on a full disk", "crashed", {"sink.full-disk"}},
        {"writes_into_the_frame", "writes into the frame", "crashed", {"sink.write"}},
        {"writes_into_the_record", "writes into the record", "crashed", {"sink.write"}},
        {"reads_a_row_more", "reads a row after the frame", "crashed", {"sink.write"}},
        {"hang_in_start", "never returns from start", "timeout", {"sink.start"}},
        {"hang_in_write", "never returns from write", "timeout", {"sink.write"}},
        {"hangs_on_a_full_disk", "never returns from write on a full disk", "timeout", {"sink.full-disk"}},
        {"status_0", "returns 0 from write", "fail", {"sink.write"}},
        {"stop_fails", "stop always fails", "fail", {"sink.start"}},
        {"idle_fails", "idle always fails", "fail", {"sink.idle"}},
        {"caches_beside_its_library", "writes a file next to its library", "fail", {"sink.start"}},
        {"refuses_odd_sizes_without_a_word", "rejects odd sizes without an error message", "fail", {"sink.sizes"}},
        {"wants_every_number", "rejects gaps in sequence numbers", "fail", {"sink.gaps"}},
        {"cancelled_is_internal", "write returns INTERNAL once cancelled", "fail", {"sink.cancelled"}},
        {"start_cancelled_is_internal", "start returns INTERNAL once cancelled", "fail", {"sink.cancelled"}},
        {"starts_once",
         "cannot be started a second time",
         "fail",
         {"sink.sizes", "sink.cancelled", "sink.leaks", "sink.files", "sink.earlier-files", "sink.restart"}},
        {"appends_to_an_old_log", "appends to an earlier run's log", "fail", {"sink.start-again"}},
        {"mixes_instances", "writes into the files of another instance", "fail", {"sink.two-instances"}},
        {"leaks_descriptors", "leaks a descriptor per frame", "fail", {"sink.leaks"}},
        {"leaks_many_descriptors", "leaks three descriptors per frame", "fail", {"sink.leaks"}},
        {"leaks_descriptors_in_start", "leaks a descriptor per start", "fail", {"sink.leaks"}},
        {"leaks_memory", "leaks 1 KiB per frame", "fail", {"sink.leaks"}},
        {"leaves_threads", "leaves a thread running with each frame", "fail", {"sink.leaks"}},
        {"writes_no_file", "writes no file", "fail", {"sink.files", "sink.every-frame"}},
        {"rows_follow_each_other", "ignores the stride", "fail", {"sink.stride"}},
        {"drops_every_10th", "drops every tenth frame", "fail", {"sink.every-frame"}},
        {"writes_frames_in_pairs",
         "writes pairs of frames in reverse order",
         "fail",
         {"sink.every-frame", "sink.order"}},
        {"keeps_all_to_its_end", "writes nothing before stop", "fail", {"sink.every-frame", "sink.restart"}},
        {"writes_each_frame_twice", "writes each frame twice", "fail", {"sink.order"}},
        {"exchanges_frames", "swaps every fourth frame with the previous one", "fail", {"sink.order"}},
        {"newest_first", "writes the newest frame's line first", "fail", {"sink.order"}},
        {"blackens_a_frame_of_a_film", "writes a film in which every fifth frame is black", "fail", {"sink.order"}},
        {"writes_the_frame_before", "writes the previous frame", "fail", {"sink.last-frame", "sink.restart"}},
        {"empties_at_start", "empties an earlier run's log in start", "fail", {"sink.earlier-files"}},
        {"looks_for_no_place", "start does not check that it can write", "fail", {"sink.no-place"}},
        {"half_files", "writes files in pieces under their final names", "fail", {"sink.killed", "sink.full-disk"}},
        {"forgets_on_restart", "empties its log when restarted after a kill", "fail", {"sink.restart"}},
        {"writes_twice_on_restart", "appends repeated frames after a kill", "fail", {"sink.restart"}},
        {"drops_frames_on_a_slow_disk", "drops a frame after a slow write", "fail", {"sink.slow-disk"}},
        {"hides_a_full_disk", "returns OK on a full disk", "fail", {"sink.full-disk"}},
        {"half_files_on_a_full_disk", "leaves half a file on a full disk", "fail", {"sink.full-disk"}},
        {"slow", "takes 120 ms per frame", "warn", {"sink.speed"}},
    });

} // namespace arhost::test
