//! The board with real processes: typed services, deaths, wake-ups, and what is left behind.
//!
//! Without the usual harness, because this binary is also the services that it starts.

// The lint knows tests by their attribute, which there is none of here.
#![allow(clippy::unwrap_used)]

mod bells;
mod chaos;
mod damage;
mod launchers;
mod memory;
mod ports;
mod robot;
mod runner;
mod services;
mod teardown;

use std::process::ExitCode;

fn main() -> ExitCode {
    match std::env::var(services::WHICH).as_deref() {
        Ok("host") => teardown::host_process(),
        Ok("robbed") => teardown::robbed_process(),
        Ok("tool") => teardown::tool_process(),
        Ok("cleaner") => chaos::cleaner_process(),
        Ok("cramped") => memory::cramped_process(),
        Ok("blind") => launchers::blind_process(),
        Ok("squatted") => launchers::squatted_process(),
        Ok("bell") => bells::other_process(),
        Ok(which) => services::serve(which),
        Err(_) => runner::run(&[
            ("a_late_reader_gets_the_last_message", ports::a_late_reader_gets_the_last_message),
            ("every_message_wakes_the_reader", ports::every_message_wakes_the_reader),
            ("a_queue_keeps_every_message", ports::a_queue_keeps_every_message),
            ("a_queue_counts_what_overflow_swallows", ports::a_queue_counts_what_overflow_swallows),
            ("another_layout_is_refused_by_the_field", ports::another_layout_is_refused_by_the_field),
            ("a_second_publisher_is_refused", ports::a_second_publisher_is_refused),
            (
                "a_large_message_is_read_where_it_was_written",
                ports::a_large_message_is_read_where_it_was_written,
            ),
            ("a_stamp_from_the_future_does_not_count", ports::a_stamp_from_the_future_does_not_count),
            ("random_bytes_are_survived", ports::random_bytes_are_survived),
            ("what_a_service_is_needs_no_data", ports::what_a_service_is_needs_no_data),
            ("every_service_publishes_its_health", ports::every_service_publishes_its_health),
            ("bells_wake_across_processes", bells::bells_wake_across_processes),
            ("a_killed_host_is_swept_with_its_services", teardown::a_killed_host_is_swept_with_its_services),
            (
                "a_tools_place_is_taken_over_after_its_death",
                teardown::a_tools_place_is_taken_over_after_its_death,
            ),
            ("a_folder_of_somebody_else_is_left_alone", teardown::a_folder_of_somebody_else_is_left_alone),
            ("a_launcher_without_its_lock_lives", launchers::a_launcher_without_its_lock_lives),
            ("a_launcher_without_its_folder_lives", launchers::a_launcher_without_its_folder_lives),
            ("a_board_whose_folder_was_deleted_knows", launchers::a_board_whose_folder_was_deleted_knows),
            ("who_can_open_nothing_calls_nobody_dead", launchers::who_can_open_nothing_calls_nobody_dead),
            ("everything_is_its_owners", launchers::everything_is_its_owners),
            ("a_strangers_file_is_refused_by_its_name", launchers::a_strangers_file_is_refused_by_its_name),
            ("a_page_that_was_written_over_heals", damage::a_page_that_was_written_over_heals),
            ("a_message_without_room_is_lost_and_said", memory::a_message_without_room_is_lost_and_said),
            ("what_cannot_be_said_is_no_panic", launchers::what_cannot_be_said_is_no_panic),
            ("nothing_is_inherited", launchers::nothing_is_inherited),
            ("damage_is_said", damage::damage_is_said),
            ("nonsense_is_no_silence", damage::nonsense_is_no_silence),
            ("deaths_during_start_up_break_nothing", chaos::deaths_during_start_up_break_nothing),
        ]),
    }
}
