mod journey;
mod rooms;
