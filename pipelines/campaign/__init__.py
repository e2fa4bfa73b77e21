"""Campaigns: analyses, trainings and diagnoses over hundreds of recordings, planned, carried out and shown."""
