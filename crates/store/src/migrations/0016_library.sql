-- Whether a template is fitted wherever `model=auto`, beside the built-in hearts. What was uploaded
-- before this was a setting has to be flagged.
ALTER TABLE holdings ADD COLUMN library INTEGER NOT NULL DEFAULT 0;
